// Lights without extent in paths, right-hand sides and behind near mirrors.
#include <gtest/gtest.h>

#include "octrad/device/stream_test_helper.h"
#include "octrad/scene/sample_scenes.h"
#include "octrad/transport/checks.h"
#include "octrad/transport/light_weights.h"
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

// What hangs between floor and lamps, at heights below 2.
struct Veil {
  float opacity;
  float height = 1.0f;
  BsdfType type = BsdfType::diffuse;
};

// The floor under two lamps and, over x >= 0 of it, veils.
PreparedScene veiled_scene(const std::vector<Veil>& veils, bool through_masks, float floor_alpha = 0.0f) {
  SceneMaker maker;
  const int floor = floor_alpha > 0.0f ? maker.rough_metal(floor_alpha) : maker.diffuse({0.5f, 0.25f, 1.0f});
  maker.quad({-5, -5, 0}, {10, 0, 0}, {0, 10, 0}, floor);
  for (const Veil& veil : veils) {
    Material m;
    m.type = veil.type;
    if (veil.type == BsdfType::diffuse) m.reflectance = maker.texture(0.0f);
    if (veil.opacity < 1.0f && veil.type != BsdfType::null) m.opacity = maker.texture(veil.opacity);
    maker.quad({0, -5, veil.height}, {5, 0, 0}, {0, 10, 0}, maker.material(m));
  }
  DeltaLight sun;
  sun.kind = DeltaLight::Kind::directional;
  sun.axis = {0, 0, -1};
  sun.intensity = Vec3f(2.0f);
  maker.scene.delta_lights = {point_light({1, 0, 2}, Vec3f(3.0f)), sun};
  for (DeltaLight& l : maker.scene.delta_lights) l.through_masks = through_masks;
  return PreparedScene(std::move(maker.scene));
}

// Of the floor at x = 1.01, whose way to both lamps crosses all veils.
Vec3f seen_below(const PreparedScene& scene) {
  std::vector<PathSample> paths;
  for (unsigned i = 0; i < 400; ++i)
    paths.push_back({{{1.01f, 0, 0.01f}, {0, 0, -1}, 1e30f}, Rng(1, RngPurpose::test, i), {}, {}});
  PathCounters counters;
  trace_paths(scene.context(), {2, 5}, paths, counters);
  Vec3f mean(0.0f);
  for (const PathSample& p : paths) mean += p.radiance * (1.0f / 400.0f);
  return mean;
}

TEST(DeltaLights, ShineThroughMasksWhereAskedFor) {
  const Veil none{0.0f, 0.7f, BsdfType::null};
  const std::pair<std::vector<Veil>, float> cases[] = {
      {{}, 1.0f},
      {{{0.25f}}, 0.75f},
      {{{0.25f}, {0.5f, 1.5f}, none}, 0.375f},
      {{{0.25f}, {1.0f, 0.5f}}, 0.0f},
      {std::vector<Veil>(40, none), 1.0f},
      {{{0.25f}, {0.5f, 1.5f, BsdfType::dielectric}}, 0.5f * 0.75f},  // masked glass: what is left beside the glass
      {{{0.25f}, {1.0f, 1.5f, BsdfType::dielectric}}, 0.0f}};
  const float free = seen_below(veiled_scene({}, false)).y;
  EXPECT_NEAR(free, 0.25f / kPi * (2.0f + 3.0f / 4.0f), 0.06f * free);  // one lamp a path
  for (const auto& [veils, left] : cases) {
    EXPECT_NEAR(seen_below(veiled_scene(veils, true)).y, left * free, 1e-4f * free) << veils.size();
    EXPECT_EQ(seen_below(veiled_scene(veils, false)).y, veils.empty() ? free : 0.0f) << veils.size();
  }
}

// Rays start again just behind each mask, which far from the origin is a good way on: still they end before the lamp,
// and what is behind it does not matter.
TEST(DeltaLights, MasksLeaveTheLampInItsPlace) {
  for (const int masks : {0, 1, 3}) {
    SceneMaker maker;
    const float x = 1000.0f;
    maker.quad({x - 5, -5, 0}, {10, 0, 0}, {0, 10, 0}, maker.diffuse(Vec3f(0.5f)));
    Material nothing;
    nothing.type = BsdfType::null;
    const int mask = maker.material(nothing);
    for (int i = 0; i < masks; ++i) maker.quad({x - 5, -5, 2.0f + static_cast<float>(i)}, {10, 0, 0}, {0, 10, 0}, mask);
    maker.quad({x - 5, -5, 20.05f}, {10, 0, 0}, {0, 10, 0}, maker.diffuse(Vec3f(0.5f)));
    maker.scene.delta_lights = {point_light({x, 0, 20}, Vec3f(400.0f))};
    maker.scene.delta_lights[0].through_masks = true;
    const PreparedScene scene(std::move(maker.scene));
    std::vector<PathSample> paths = {{{{x, 0, 1}, {0, 0, -1}, 1e30f}, Rng(1, RngPurpose::test, 0), {}, {}}};
    PathCounters counters;
    trace_paths(scene.context(), {2, 5}, paths, counters);
    EXPECT_NEAR(paths[0].radiance.y, 0.5f / kPi, 1e-3f) << masks;
  }
}

TEST(DeltaLights, TooManyMasksBlockThem) {
  std::vector<Veil> veils;
  for (int i = 0; i < 300; ++i) veils.push_back({0.0f, 0.5f + 0.003f * static_cast<float>(i), BsdfType::null});
  EXPECT_EQ(seen_below(veiled_scene(veils, true)).y, 0.0f);
}

TEST(DeltaLights, RightHandSidesAndPicksKnowOfMasks) {
  for (const bool through : {true, false}) {
    const PreparedScene scene = veiled_scene({{0.25f}, {0.5f, 1.5f}}, through);
    const TransportContext context = scene.context();
    const Vec3f origin{1.01f, 0, 0.01f};
    const Hit hit = context.intersect(origin, {0, 0, -1}, 0.0f, 1e30f);
    const std::vector<ShadingPoint> points(1, context.shade(context.interact(hit, origin, {0, 0, -1}), {0, 0, 1}));
    std::vector<Vec3f> targets(1);
    RhsOptions options;
    options.directions = 512;
    estimate_rhs(context, points, options, {}, targets);
    const float expected = through ? seen_below(scene).y : 0.0f;
    EXPECT_NEAR(targets[0].y, expected, 0.06f * expected);  // one lamp a path
  }
  // Of two lamps, one of which is hidden but for what masks let through.
  const auto picks = [](bool through) {
    SceneMaker maker;
    maker.quad({-5, -5, 0}, {10, 0, 0}, {0, 10, 0}, maker.diffuse(Vec3f(0.5f)));
    Material veil;
    veil.opacity = maker.texture(0.2f);
    maker.quad({-9, -9, 5}, {18, 0, 0}, {0, 18, 0}, maker.material(veil));
    maker.camera({0, 0, 4}, {0.1f, 0, 0}, 60.0f, 16, 16);
    maker.scene.delta_lights = {point_light({0, 0, 3}, Vec3f(1.0f)), point_light({0, 0, 6}, Vec3f(8.0f))};
    for (DeltaLight& l : maker.scene.delta_lights) l.through_masks = through;
    return light_weights(PreparedScene(std::move(maker.scene)).context());
  };
  EXPECT_GT(picks(true)[1], 0.3f);
  EXPECT_LT(picks(false)[1], 0.15f);
}

TEST(DeltaLights, NearMirrorsShowThemThroughMasks) {
  const Vec3f eye{0.4f, 0, 0.4f}, direction = normalize(Vec3f(0.51f, 0.01f, 0) - eye);
  const auto emitted = [&](const std::vector<Veil>& veils) {
    const PreparedScene scene = veiled_scene(veils, true, 0.05f);
    double sum = 0.0;
    for (unsigned i = 0; i < 64; ++i) {
      Rng rng(1, RngPurpose::test, i);
      const RayEnd end = follow_ray(scene.context(), eye, nullptr, direction, rng, 0.1f, 4);
      sum += static_cast<double>(end.emitted.y);
    }
    return sum;
  };
  const double free = emitted({});
  ASSERT_GT(free, 0.0);
  EXPECT_NEAR(emitted({{0.25f}}), 0.75 * free, 1e-4 * free);
}

class DeviceDeltaLights : public testing::StreamTest {};

// Through the room's curtain.
TEST_P(DeviceDeltaLights, ShineThroughMasks) {
  Scene room = testing::open_room({false, true});
  room.delta_lights = {point_light({0.3f, 1.5f, 3.0f}, Vec3f(5.0f)), point_light({-0.2f, 1.0f, -0.5f}, Vec3f(2.0f))};
  for (DeltaLight& l : room.delta_lights) l.through_masks = true;
  const PreparedScene scene(std::move(room), PreparedScene::CpuTree::bvh8);
  const CameraJob job = camera_job(scene, 24, 18, 4, 3);
  const PathLimits limits{5, 5};
  for (const int waves : {2, 16})
    EXPECT_TRUE(testing::passed(check_paths(*stream, scene, {&job, 1}, {&limits, 1}, waves))) << waves;
  const RhsCase c{8, false, false, false, false, false, 0.3f};
  EXPECT_TRUE(testing::passed(check_right_hand_sides(*stream, scene, {&c, 1}, 300, 11)));
}

INSTANTIATE_TEST_SUITE_P(All, DeviceDeltaLights, ::testing::Bool(), testing::stream_name);

}  // namespace
}  // namespace octrad
