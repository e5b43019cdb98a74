// Learns what a glossy floor shows and must reach a stated error; with the disparity, an interpolation or the direction
// of the look-up deliberately broken the same training must miss it. The room's walls only emit (a checkerboard each),
// so the reference is one bounce: exact light transport without noise to speak of, and every error is the field's.
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <fstream>

#include "octrad/base/sanitized_test_helper.h"
#include "octrad/scene/load.h"
#include "octrad/train/trainer.h"
#include "octrad/transport/query_point.h"
#include "octrad/transport/rhs_estimator.h"

namespace octrad {
namespace {

std::string wall(const std::string& transform) {
  return R"(<shape type="rectangle"><transform name="to_world">)" + transform + R"(</transform>
    <bsdf type="diffuse"><rgb name="reflectance" value="0"/></bsdf><emitter type="area"><texture name="radiance" type="checkerboard">
    <rgb name="color0" value="0.2, 0.3, 0.6"/><rgb name="color1" value="1.5, 1.1, 0.7"/><transform name="to_uv"><scale x="2" y="2"/></transform>
    </texture></emitter></shape>)";
}

Scene checkered_room() {
  const auto file = std::filesystem::temp_directory_path() / ("octrad_learning_" + std::to_string(::getpid()) + ".xml");
  std::ofstream(file)
      << R"(<scene version="3.0.0"><sensor type="perspective"><float name="fov" value="70"/><transform name="to_world">
    <lookat origin="0, 0.4, 0.9" target="0, -0.9, -0.5" up="0, 1, 0"/></transform><film type="hdrfilm"><integer name="width" value="48"/>
    <integer name="height" value="48"/></film></sensor>)"
      << wall(R"(<translate z="-1"/>)") << wall(R"(<rotate y="1" angle="180"/><translate z="1"/>)")
      << wall(R"(<rotate y="1" angle="90"/><translate x="-1"/>)")
      << wall(R"(<rotate y="1" angle="-90"/><translate x="1"/>)")
      << wall(R"(<rotate x="1" angle="90"/><translate y="1"/>)")
      << R"(<shape type="rectangle"><transform name="to_world"><rotate x="1" angle="-90"/><translate y="-1"/></transform>
    <bsdf type="twosided"><bsdf type="roughconductor"><string name="material" value="none"/><float name="alpha" value="0.05"/></bsdf></bsdf></shape></scene>)";
  Scene scene = load_scene(file.string());
  std::filesystem::remove(file);
  return scene;
}

// Mean relative error of a trained field over the floor, seen from the camera and from a place that no pose favours.
double learned_error(const PreparedScene& scene, const Config& config) {
  const TransportContext context = scene.context();
  const TrainResult trained = train(scene, config, {});
  std::vector<ShadingPoint> floor;
  for (const Camera& camera : {context.scene.cameras[0], look_at({0.6f, -0.3f, -0.6f}, {-0.3f, -1.0f, 0.2f}, {0, 1, 0},
                                                                 70.0f, Camera::FovAxis::x)}) {
    for (int y = 0; y < 32; ++y) {
      for (int x = 0; x < 32; ++x) {
        Rng rng(1, RngPurpose::test, 0);
        const Ray ray = camera_ray(camera.view(32, 32), {static_cast<float>(x) + 0.5f, static_cast<float>(y) + 0.5f});
        const RayEnd end = follow_ray(context, ray.origin, nullptr, ray.direction, rng, 0.0f, 1);
        if (end.surface && end.point.surface.emitter < 0) floor.push_back(end.point);
      }
    }
  }
  std::vector<Vec3f> reference(floor.size()), predicted(floor.size());
  RhsOptions rhs;
  rhs.directions = 256;
  rhs.seed = 99;
  estimate_rhs(context, floor, rhs, nullptr, reference);
  std::vector<SurfacePoint> points;
  Rng rng(2, RngPurpose::test, 0);
  for (const ShadingPoint& p : floor) points.push_back(field_query_point(context, p, query_rays(config), rng));
  trained.field->radiance(points, predicted);
  double error = 0.0;
  for (std::size_t i = 0; i < floor.size(); ++i) {
    for (int c = 0; c < 3; ++c) error += std::abs(predicted[i][c] - reference[i][c]) / (reference[i][c] + 0.01f);
  }
  return error / (3.0 * static_cast<double>(floor.size()));
}

TEST(Learning, ReachesTheStatedErrorAndMissesItWithAnyPartBroken) {
  if (testing::sanitized()) GTEST_SKIP() << "takes minutes under the sanitizers; the parts are tested there one by one";
  const PreparedScene scene(checkered_room());
  Config config = preset("cpu");
  config.train_steps = 1000;
  config.train_points = 512;
  config.train_directions = 4;
  config.octree_levels = 4;
  config.lookup_offset = LookupOffset::predicted;
  config.disparity_log2_table = 12;
  config.decoder_width = 64;
  config.decoder_hidden = 2;

  // Measured: .119 whole, .153 without the interpolation of cells, .175 to .196 without the other parts.
  constexpr double kStated = 0.135;
  const double whole = learned_error(scene, config);
  RecordProperty("error", std::to_string(whole));
  EXPECT_LT(whole, kStated);
  Config traced = config;
  traced.lookup_offset = LookupOffset::traced;
  EXPECT_LT(learned_error(scene, traced), whole);
  for (const auto& [key, value] : std::vector<std::pair<std::string, std::string>>{{"lookup.offset", "none"},
                                                                                   {"octree.interpolation", "nearest"},
                                                                                   {"octa.interpolation", "nearest"},
                                                                                   {"lookup.direction", "outgoing"}}) {
    Config broken = config;
    set(broken, key, value);
    const double error = learned_error(scene, broken);
    EXPECT_GT(error, kStated) << key << "=" << value << " does no harm: the test does not see that part";
  }
}

// Cones see the checkerboard that a grid at the floor has to learn from directions.
TEST(Learning, ConesShowWhatAGridAloneDoesNot) {
  if (testing::sanitized()) GTEST_SKIP() << "takes minutes under the sanitizers";
  const PreparedScene scene(checkered_room());
  Config config = preset("cpu");
  config.train_steps = 1000;
  config.train_points = 512;
  config.train_directions = 4;
  config.nr_log2_table = config.ncr_log2_table = config.ncr_cone_log2_table = 14;
  constexpr double kStated = 0.15;  // measured: 0.07 with cones, 0.25 without
  config.field = "ncr";
  const double cones = learned_error(scene, config);
  config.field = "nr";
  const double grid = learned_error(scene, config);
  RecordProperty("errors", std::to_string(cones) + " " + std::to_string(grid));
  EXPECT_LT(cones, kStated);
  EXPECT_GT(grid, kStated);
}

}  // namespace
}  // namespace octrad
