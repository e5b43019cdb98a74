// Lights without extent in paths, right-hand sides and behind near mirrors.
#include <gtest/gtest.h>

#include "octrad/scene/sample_scenes.h"
#include "octrad/transport/path.h"
#include "octrad/transport/prepared_scene.h"
#include "octrad/transport/rhs_estimator.h"

namespace octrad {
namespace {

using testing::SceneMaker;

DeltaLight point_light(Vec3f position, Vec3f intensity) {
  DeltaLight l;
  l.position = position;
  l.intensity = intensity;
  return l;
}

// A white floor z = 0 under a lamp at height 2: E = I cos / d^2 and L = albedo E / pi, without any noise.
PreparedScene floor_scene(std::size_t lamps) {
  SceneMaker maker;
  maker.quad({-5, -5, 0}, {10, 0, 0}, {0, 10, 0}, maker.diffuse({0.5f, 0.25f, 1.0f}));
  for (std::size_t i = 0; i < lamps; ++i) maker.scene.delta_lights.push_back(point_light({1, 0, 2}, Vec3f(3.0f)));
  return PreparedScene(std::move(maker.scene));
}

Vec3f expected_at(Vec3f p) {
  const Vec3f d = Vec3f(1, 0, 2) - p;
  const float l2 = dot(d, d);
  return Vec3f(0.5f, 0.25f, 1.0f) * (3.0f * (2.0f / std::sqrt(l2)) / l2 / kPi);
}

TEST(DeltaLights, PathsFindThemByNextEventEstimationAlone) {
  for (const std::size_t lamps : {1u, 3u}) {
    const PreparedScene scene = floor_scene(lamps);
    std::vector<PathSample> paths;
    for (int i = 0; i < 50; ++i) {
      const Vec3f at{0.05f * static_cast<float>(i), -0.3f, 0.0f};
      paths.push_back({{at + Vec3f(0, 0, 3), {0, 0, -1}, 1e30f}, Rng(1, RngPurpose::test, i), {}, {}});
    }
    PathCounters counters;
    trace_paths(scene.context(), {4, 5}, paths, counters);
    for (int i = 0; i < 50; ++i) {
      const Vec3f expected = expected_at({0.05f * static_cast<float>(i), -0.3f, 0.0f}) * static_cast<float>(lamps);
      EXPECT_NEAR(paths[static_cast<std::size_t>(i)].radiance.x, expected.x, 1e-4f);
      EXPECT_NEAR(paths[static_cast<std::size_t>(i)].radiance.z, expected.z, 1e-4f);
    }
  }
}

TEST(DeltaLights, RightHandSidesHoldThem) {
  const PreparedScene scene = floor_scene(2);
  const TransportContext context = scene.context();
  std::vector<ShadingPoint> points;
  for (int i = 0; i < 40; ++i) {
    const Vec3f origin{-1.0f + 0.07f * static_cast<float>(i), 0.4f, 1.0f};
    const Hit hit = context.intersect(origin, {0, 0, -1}, 0.0f, 1e30f);
    ASSERT_TRUE(hit.valid());
    points.push_back(context.shade(context.interact(hit, origin, {0, 0, -1}), normalize(Vec3f(0.3f, 0.1f, 1))));
  }
  std::vector<Vec3f> targets(points.size());
  RhsOptions options;
  options.directions = 8;
  estimate_rhs(context, points, options, {}, targets);
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Vec3f expected = expected_at(points[i].surface.position) * 2.0f;
    EXPECT_NEAR(targets[i].y, expected.y, 1e-4f * expected.y);
  }
}

// A highlight of a lamp without extent on a near mirror that rays follow is seen by light sampling only.
TEST(DeltaLights, NearMirrorsShowTheirHighlights) {
  SceneMaker maker;
  const int metal = maker.rough_metal(0.05f);
  maker.quad({-5, -5, 0}, {10, 0, 0}, {0, 10, 0}, metal);
  maker.scene.delta_lights.push_back(point_light({1, 0, 1}, Vec3f(3.0f)));
  const PreparedScene scene(std::move(maker.scene));
  const TransportContext context = scene.context();
  const Vec3f eye{-1, 0, 1}, direction = normalize(Vec3f(0.02f, 0.01f, 0) - eye);
  Rng rng(1, RngPurpose::test, 0);
  const RayEnd end = follow_ray(context, eye, nullptr, direction, rng, 0.1f, 4);
  EXPECT_FALSE(end.surface);
  std::vector<PathSample> paths = {{{eye, direction, 1e30f}, Rng(1, RngPurpose::test, 0), {}, {}}};
  PathCounters counters;
  trace_paths(context, {2, 5}, paths, counters);
  ASSERT_GT(paths[0].radiance.y, 1.0f);
  EXPECT_NEAR(end.emitted.y, paths[0].radiance.y, 1e-4f * paths[0].radiance.y);
}

}  // namespace
}  // namespace octrad
