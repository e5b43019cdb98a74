// The box of a field: rooms keep the scene's, scenes with far surfaces get a smaller one, and what lies outside
// answers.
#include "octrad/train/domain.h"

#include <gtest/gtest.h>

#include "octrad/base/sanitized_test_helper.h"
#include "octrad/base/threads.h"
#include "octrad/scene/files_test_helper.h"
#include "octrad/train/box_test_helper.h"
#include "octrad/train/narrow_networks_test_helper.h"
#include "octrad/train/trainer.h"

namespace octrad {
namespace {

// Three spheres of radius 0.5 on a ground of 200 x 200, seen from 4 away.
struct Open {
  PreparedScene scene{load()};
  static Scene load() {
    const auto file = std::filesystem::temp_directory_path() / ("octrad_open_" + std::to_string(::getpid()) + ".xml");
    std::ofstream(file)
        << R"(<scene version="3.0.0"><sensor type="perspective"><float name="fov" value="45"/><transform name="to_world">
      <lookat origin="0,1.5,-4" target="0,0.4,0" up="0,1,0"/></transform><film type="hdrfilm"><integer name="width" value="64"/>
      <integer name="height" value="64"/></film></sensor><emitter type="constant"/>
      <shape type="rectangle"><transform name="to_world"><scale value="100"/><rotate x="1" angle="-90"/></transform><bsdf type="diffuse"/></shape>
      <shape type="sphere"><point name="center" x="-1.2" y="0.5" z="0"/><float name="radius" value="0.5"/><bsdf type="diffuse"/></shape>
      <shape type="sphere"><point name="center" x="0" y="0.5" z="0.4"/><float name="radius" value="0.5"/>
        <bsdf type="roughconductor"><float name="alpha" value="0.1"/></bsdf></shape>
      <shape type="sphere"><point name="center" x="1.2" y="0.5" z="0"/><float name="radius" value="0.5"/><bsdf type="diffuse"/></shape></scene>)";
    Scene scene = load_scene(file.string());
    std::filesystem::remove(file);
    return scene;
  }
};

TEST(Domain, ARoomKeepsItsBox) {
  const testing::Box box;
  for (const char* kind : {"auto", "scene"}) {
    for (const char* shape : {"cube", "axis"}) {
      Config config = preset("cpu");
      set(config, "octree.bounds", kind);
      set(config, "octree.box", shape);
      const DomainFit fit = fit_domain(box.scene, config);
      const Domain whole = scene_domain(box.scene.scene().bounds, config.octree_box == OctreeBox::cube);
      EXPECT_EQ(fit.box.origin, whole.origin);
      EXPECT_EQ(fit.box.size, whole.size);
      EXPECT_EQ(fit.outside, 0.0);
      EXPECT_EQ(domain_warning(fit), "");
    }
  }
}

// What was measured in them stays as it was.
TEST(Domain, SharedRoomsKeepTheirBoxes) {
  if (testing::sanitized()) GTEST_SKIP() << "takes half a minute under the sanitizers";
  int found = 0;
  for (const char* name : {"bathroom", "cornell-box", "kitchen", "living-room", "veach-ajar"}) {
    const std::filesystem::path file = shared_folder() / "scenes" / name / "scene.xml";
    if (!std::filesystem::exists(file)) continue;
    const PreparedScene scene(load_scene(file.string()));
    const DomainFit fit = fit_domain(scene, preset("cpu"));
    EXPECT_EQ(fit.box.size, scene_domain(scene.scene().bounds, true).size) << name;
    EXPECT_EQ(domain_warning(fit), "") << name;
    ++found;
  }
  if (found == 0) GTEST_SKIP() << "no shared scenes";
}

TEST(Domain, AGroundWithoutEndIsNotCovered) {
  const Open open;
  Config config = preset("cpu");
  const DomainFit fit = fit_domain(open.scene, config);
  EXPECT_NEAR(fit.whole, 200.0, 0.1);
  EXPECT_LT(max_component(fit.box.size), 40.0f);
  EXPECT_GT(max_component(fit.box.size), 4.0f);
  EXPECT_GT(fit.outside, 0.0);
  EXPECT_LT(fit.outside, 0.5);
  EXPECT_NEAR(fit.cell, static_cast<double>(max_component(fit.box.size)) / 128, 1e-6);
  // The spheres are inside.
  for (const float x : {-1.7f, 1.7f}) {
    EXPECT_LT(fit.box.origin.x, -std::abs(x));
    EXPECT_GT(fit.box.origin.x + fit.box.size.x, std::abs(x));
  }
  EXPECT_NEAR(fit.distance, 4.0, 1.5);
  EXPECT_NEAR(fit.pixel, fit.distance * 2.0 * std::tan(0.3927) / 64, 1e-3);
  EXPECT_EQ(domain_warning(fit), "");

  config.octree_bounds = "scene";
  const DomainFit whole = fit_domain(open.scene, config);
  EXPECT_NEAR(max_component(whole.box.size), 200.0f, 0.1f);
  EXPECT_NE(domain_warning(whole).find("octree.bounds"), std::string::npos);
  config.octree_bounds = "-2,0,-2,2,2,2";
  const DomainFit given = fit_domain(open.scene, config);
  EXPECT_NEAR(max_component(given.box.size), 4.02f, 1e-5f);
}

TEST(Domain, IsTheSameAtAnyThreadCount) {
  const Open open;
  set_thread_count(1);
  const DomainFit one = fit_domain(open.scene, preset("cpu"));
  set_thread_count(3);
  const DomainFit three = fit_domain(open.scene, preset("cpu"));
  set_thread_count(0);
  EXPECT_EQ(one.box.origin, three.box.origin);
  EXPECT_EQ(one.box.size, three.box.size);
  EXPECT_EQ(one.pixel, three.pixel);
}

TEST(Domain, SurfacesOutsideAnswer) {
  const Open open;
  for (const std::string& field : field_names()) {
    SCOPED_TRACE(field);
    Config config = preset("cpu");
    config.field = field;
    config.octree_levels = 4;
    config.disparity_log2_table = config.nr_log2_table = config.ncr_log2_table = config.ncr_cone_log2_table = 12;
    config.ncr_rays_train = config.ncr_rays_render = 8;
    testing::narrow_networks(config);
    config.train_steps = 150;
    config.train_points = 256;
    const TrainResult result = train(open.scene, config, {});
    // White light from everywhere on grey ground: half of it comes back, spheres take some near the middle.
    for (const float x : {-90.0f, -30.0f, 8.0f, 60.0f}) {
      SurfacePoint p;
      p.x = {x, 0.0f, 20.0f};
      p.n = {0, 1, 0};
      p.wo = normalize(Vec3f(0.3f, 1.0f, 0.1f));
      p.albedo = Vec3f(0.5f);
      Vec3f radiance;
      result.field->radiance(std::span(&p, 1), std::span(&radiance, 1));
      for (int c = 0; c < 3; ++c) EXPECT_NEAR(radiance[c], 0.5f, 0.15f) << x;
    }
  }
}

}  // namespace
}  // namespace octrad
