// The cache integrators with fields whose answer is known.
#include "octrad/render/renderer.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <set>

#include "octrad/base/error.h"
#include "octrad/render/constant_field_test_helper.h"
#include "octrad/render/view_parts.h"
#include "octrad/scene/load.h"
#include "octrad/transport/prepared_scene.h"

namespace octrad {
namespace {

constexpr const char* kMirror = R"(<bsdf type="conductor"><string name="material" value="none"/></bsdf>)";

// A grey box with a sphere, a perfect mirror if nothing else is said, seen from inside; optionally all glowing.
struct Box {
  PreparedScene prepared;
  testing::ConstantField field{{2.0f, 1.0f, 0.5f}};
  RadianceField* shown = &field;
  Config config = preset("cpu");

  explicit Box(const std::string& emitter = "", const std::string& sphere = kMirror) : prepared(load(emitter, sphere)) {
    config.render_delta = DeltaSurfaces::cache;
  }
  static Scene load(const std::string& emitter, const std::string& sphere) {
    const auto file = std::filesystem::temp_directory_path() / ("octrad_cache_" + std::to_string(::getpid()) + ".xml");
    std::ofstream(file)
        << R"(<scene version="3.0.0"><sensor type="perspective"><float name="fov" value="80"/><transform name="to_world">
      <lookat origin="0,0,-0.9" target="0,0,1" up="0,1,0"/></transform><film type="hdrfilm"><integer name="width" value="32"/><integer name="height" value="24"/>
      <rfilter type="box"/></film></sensor><shape type="cube"><boolean name="flip_normals" value="true"/><bsdf type="diffuse"><rgb name="reflectance" value="0.5"/></bsdf>)"
        << emitter << R"(</shape><shape type="sphere"><float name="radius" value="0.4"/>)" << sphere
        << "</shape></scene>";
    Scene scene = load_scene(file.string());
    std::filesystem::remove(file);
    return scene;
  }
  RenderResult picture(const std::string& integrator, int spp = 1) {
    RenderSettings settings;
    settings.film = prepared.scene().film;
    settings.seed = 1;
    const auto renderer = make_renderer(prepared, integrator, settings, shown, config);
    renderer->set_view({prepared.scene().cameras[0], 32, 24});
    return render(*renderer, {spp});
  }
};

bool on_sphere(const Image& image, int x, int y) { return image.at(x, y, image.channel("roughness.Y")) < 0.01f; }

TEST(CacheIntegrators, LhsShowsTheFieldAtTheFirstHit) {
  Box box;
  const RenderResult r = box.picture("lhs", 2);
  int mirror = 0;
  for (int y = 0; y < 24; ++y) {
    for (int x = 0; x < 32; ++x) {
      EXPECT_TRUE(r.image.rgb(x, y) == Vec3f(2.0f, 1.0f, 0.5f));
      mirror += on_sphere(r.image, x, y);
    }
  }
  EXPECT_GT(mirror, 20);
  EXPECT_EQ(r.counts.queries, 32 * 24 * 2);
}

// Answers the direction in which a point looks for what it reflects, where that is not the mirror direction.
struct DirectionField : testing::ConstantField {
  using ConstantField::ConstantField;
  void radiance(std::span<const SurfacePoint> points, std::span<Vec3f> out) const override {
    for (std::size_t i = 0; i < points.size(); ++i) out[i] = points[i].reflected.w;
  }
};

// Samples of a glossy surface look for it in different directions (render.offset_spread); rough surfaces do not, nor
// the rays of right-hand sides.
TEST(CacheIntegrators, LhsLooksAboutTheMirrorDirection) {
  Box box("", R"(<bsdf type="roughconductor"><float name="alpha" value="0.2"/></bsdf>)");
  DirectionField field(Vec3f(0.0f));
  box.shown = &field;
  const auto drawn = [&](const std::string& integrator) {
    const RenderResult r = box.picture(integrator);
    int glossy = 0, rough = 0, all = 0;
    for (int y = 0; y < 24; ++y) {
      for (int x = 0; x < 32; ++x) {
        const bool shiny = r.image.at(x, y, r.image.channel("roughness.Y")) < 0.5f;
        all += shiny;
        (shiny ? glossy : rough) += r.image.rgb(x, y) != Vec3f(0.0f);
      }
    }
    EXPECT_GT(all, 20);
    EXPECT_EQ(rough, 0);
    return static_cast<double>(glossy) / all;
  };
  EXPECT_GT(drawn("lhs"), 0.9);  // not where both tilts would lead into it
  EXPECT_EQ(drawn("rhs"), 0.0);
  box.config.render_offset_spread = 0.0;
  EXPECT_EQ(drawn("lhs"), 0.0);
}

TEST(CacheIntegrators, RhsReflectsTheFieldOnce) {
  Box box;
  const RenderResult r = box.picture("rhs", 1);
  for (int y = 0; y < 24; ++y) {
    for (int x = 0; x < 32; ++x) {
      const float roughness = r.image.at(x, y, r.image.channel("roughness.Y"));
      EXPECT_NEAR(r.image.rgb(x, y).x, roughness < 0.5f ? 2.0f : 1.0f,
                  1e-3f);  // the mirror shows the cache behind it, grey walls half of it
    }
  }
}

TEST(CacheIntegrators, DeferredBouncesOnlyWhereItIsGlossy) {
  Box box;
  const RenderResult r = box.picture("deferred", 1);
  for (int y = 0; y < 24; ++y) {
    for (int x = 0; x < 32; ++x) EXPECT_NEAR(r.image.rgb(x, y).x, 2.0f, 1e-3f);
  }
}

TEST(CacheIntegrators, EmissionIsAddedOutsideTheFieldAndOnlyOnce) {
  Box box(R"(<emitter type="area"><rgb name="radiance" value="3"/></emitter>)");
  const RenderResult outside = box.picture("lhs", 1);
  box.config.target_emission = TargetEmission::inside;
  const RenderResult inside = box.picture("lhs", 1);
  for (int y = 0; y < 24; ++y) {
    for (int x = 0; x < 32; ++x) {
      EXPECT_FLOAT_EQ(outside.image.rgb(x, y).x, on_sphere(outside.image, x, y) ? 2.0f : 5.0f);
      EXPECT_FLOAT_EQ(inside.image.rgb(x, y).x, 2.0f);
    }
  }
}

TEST(CacheIntegrators, TracedMirrorsShowWhatIsBehindThem) {
  Box box(R"(<emitter type="area"><rgb name="radiance" value="3"/></emitter>)");
  box.config.render_delta = DeltaSurfaces::trace;
  const RenderResult r = box.picture("lhs", 1);
  for (int y = 0; y < 24; ++y) {
    for (int x = 0; x < 32; ++x) EXPECT_FLOAT_EQ(r.image.rgb(x, y).x, 5.0f);
  }
}

TEST(CacheIntegrators, LayersAreThoseOfTheFirstHitAlsoWhereItIsTraced) {
  Box box;
  const RenderResult cached = box.picture("lhs", 1);
  box.config.render_delta = DeltaSurfaces::trace;
  const RenderResult traced = box.picture("lhs", 1);
  int mirror = 0;
  for (const char* layer : {"albedo.R", "normal.X", "normal.Z", "depth.Z", "roughness.Y"}) {
    const int c = cached.image.channel(layer);
    for (int y = 0; y < 24; ++y) {
      for (int x = 0; x < 32; ++x)
        EXPECT_EQ(traced.image.at(x, y, c), cached.image.at(x, y, c)) << layer << " " << x << "," << y;
    }
  }
  for (int y = 0; y < 24; ++y) {
    for (int x = 0; x < 32; ++x) mirror += on_sphere(traced.image, x, y);
  }
  EXPECT_GT(mirror, 20);
}

TEST(Views, DisparityTracedFeaturesOccupancy) {
  Box box;
  const RenderResult disparity = box.picture("disparity", 1);
  EXPECT_FLOAT_EQ(disparity.image.rgb(3, 3).x, 0.25f);
  const RenderResult traced = box.picture("traced", 1);
  for (int y = 0; y < 24; ++y) {
    for (int x = 0; x < 32; ++x)
      EXPECT_GT(traced.image.rgb(x, y).x, 1.0f / (2.0f * std::sqrt(3.0f)));  // nothing is farther than the diagonal
  }
  const RenderResult features = box.picture("features2");
  float low = 1e9f, high = -1e9f;
  for (int x = 0; x < 32; ++x) {
    low = std::min(low, features.image.rgb(x, 12).x);
    high = std::max(high, features.image.rgb(x, 12).x);
  }
  EXPECT_GT(high - low, 0.5f);
  EXPECT_LE(high, 1.0f);
  const RenderResult occupancy = box.picture("occupancy1", 1);
  std::set<float> colors;
  for (int y = 0; y < 24; ++y) {
    for (int x = 0; x < 32; ++x) {
      const Vec3f color = occupancy.image.rgb(x, y);
      ASSERT_TRUE(is_finite(color) && min_component(color) >= 0.0f && max_component(color) <= 1.0f);
      colors.insert(color.x);
    }
  }
  EXPECT_GT(colors.size(), 4u);
  // The front of the sphere at (0, 0, -.4), a little to the right and above: x is negative there.
  EXPECT_TRUE(occupancy.image.rgb(16, 11) == cell_color({0.49f, 0.51f, 0.34f}, 1));
  try {
    box.picture("feature2", 1);
    FAIL();
  } catch (const UsageError& e) {
    EXPECT_NE(std::string(e.what()).find("features2"), std::string::npos);
  }
}

}  // namespace
}  // namespace octrad
