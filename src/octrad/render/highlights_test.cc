// When a picture from the cache takes a bounce: lamps and surfaces that decide it, and what the picture shows then.
#include "octrad/render/highlights.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>

#include "octrad/render/constant_field_test_helper.h"
#include "octrad/render/renderer.h"
#include "octrad/scene/load.h"

namespace octrad {
namespace {

// A floor of roughness `alpha` (1: diffuse) seen from 45 degrees, and a lamp of radius `radius` where it is reflected,
// 4 away from the floor's middle, of unit power whatever its size.
struct Floor {
  PreparedScene prepared;
  testing::ConstantField field{{0.25f, 0.25f, 0.25f}};
  Config config = preset("cpu");

  Floor(double alpha, double radius, const std::string& more = "") : prepared(load(alpha, radius, more)) {}
  static Scene load(double alpha, double radius, const std::string& more) {
    const auto file = std::filesystem::temp_directory_path() / ("octrad_lamps_" + std::to_string(::getpid()) + ".xml");
    std::ofstream out(file);
    out << R"(<scene version="3.0.0"><sensor type="perspective"><float name="fov" value="10"/><transform name="to_world">
      <lookat origin="0,3,-3" target="0,0,0" up="0,1,0"/></transform><film type="hdrfilm"><integer name="width" value="16"/>
      <integer name="height" value="16"/><rfilter type="box"/></film></sensor>
      <shape type="rectangle"><transform name="to_world"><rotate x="1" angle="-90"/></transform>)";
    if (alpha < 1.0) out << R"(<bsdf type="roughconductor"><float name="alpha" value=")" << alpha << R"("/></bsdf>)";
    else out << R"(<bsdf type="diffuse"/>)";
    out << R"(</shape><shape type="sphere"><point name="center" x="0" y="2.8284" z="2.8284"/><float name="radius" value=")"
        << radius
        << R"("/><bsdf type="diffuse"><rgb name="reflectance" value="0"/></bsdf><emitter type="area"><rgb name="radiance" value=")"
        << 1.0 / (radius * radius) << R"("/></emitter></shape>)" << more << "</scene>";
    out.close();
    Scene scene = load_scene(file.string());
    std::filesystem::remove(file);
    return scene;
  }
  RenderResult picture() {
    RenderSettings settings;
    settings.film = prepared.scene().film;
    const auto renderer = make_renderer(prepared, "lhs", settings, &field, config);
    renderer->set_view({prepared.scene().cameras[0], 16, 16});
    return render(*renderer, {64});
  }
};

// A disk of radius 3.2 degrees is 0.22 wide at a distance of 4.
TEST(Highlights, LampsThatAreSmallFromGlossySurfacesMatter) {
  EXPECT_GT(small_lamp_share(Floor(0.05, 0.05).prepared, 0.1f), 0.99);
  EXPECT_GT(small_lamp_share(Floor(0.05, 0.15).prepared, 0.1f), 0.9);
  EXPECT_LT(small_lamp_share(Floor(0.05, 0.4).prepared, 0.1f), 0.05);
  // No surface that is glossy enough; no lamp but the sky.
  EXPECT_EQ(small_lamp_share(Floor(0.2, 0.05).prepared, 0.1f), 0.0);
  EXPECT_EQ(small_lamp_share(Floor(1.0, 0.05).prepared, 0.1f), 0.0);
  // A lamp without extent is small from everywhere, also when it is all there is besides the other's dark side.
  const Floor lit(
      0.05, 0.4,
      R"(<emitter type="point"><point name="position" x="0" y="3" z="0"/><rgb name="intensity" value="99"/></emitter>)");
  EXPECT_GT(small_lamp_share(lit.prepared, 0.1f), 0.3);
  // Beside a sky that gives a hundred times as much light it does not matter.
  const Floor sky(0.05, 0.05, R"(<emitter type="constant"><rgb name="radiance" value="10"/></emitter>)");
  EXPECT_LT(small_lamp_share(sky.prepared, 0.1f), 0.05);
  EXPECT_EQ(bounce_below(sky.prepared, sky.config), 0.0f);
}

TEST(Highlights, KeysDecide) {
  const Floor small(0.05, 0.05), large(0.05, 0.4);
  Config config = preset("cpu");
  EXPECT_EQ(config.render_highlights, Highlights::automatic);
  EXPECT_EQ(preset("paper").render_highlights, Highlights::cache);
  EXPECT_EQ(bounce_below(small.prepared, config), static_cast<float>(config.render_bounce_below));
  EXPECT_EQ(bounce_below(large.prepared, config), 0.0f);
  config.render_highlights = Highlights::bounce;
  EXPECT_EQ(bounce_below(large.prepared, config), static_cast<float>(config.render_bounce_below));
  config.render_highlights = Highlights::cache;
  EXPECT_EQ(bounce_below(small.prepared, config), 0.0f);
  config.render_highlights = Highlights::automatic;
  config.render_bounce_below = 0.01;
  EXPECT_EQ(bounce_below(small.prepared, config), 0.0f);  // nothing is as smooth
}

TEST(Highlights, ABounceShowsTheLampThatTheCacheLacks) {
  Floor floor(0.05, 0.05);
  const RenderResult bounced = floor.picture();
  EXPECT_GT(bounced.image.rgb(8, 8).x, 5.0f);
  floor.config.lookup_offset = LookupOffset::none;
  floor.config.render_highlights = Highlights::cache;
  floor.config.render_metal_samples = 0.0;
  const RenderResult cached = floor.picture();
  for (int y = 0; y < 16; ++y) {
    for (int x = 0; x < 16; ++x) EXPECT_FLOAT_EQ(cached.image.rgb(x, y).x, 0.25f);
  }
  EXPECT_GT(bounced.counts.rays, 2 * cached.counts.rays);
}

}  // namespace
}  // namespace octrad
