#include "octrad/transport/path.h"
#include "octrad/transport/prepared_scene.h"

#include <gtest/gtest.h>

#include <vector>

#include "octrad/scene/sample_scenes.h"

namespace octrad {
namespace {

using testing::SceneMaker;

struct World {
  PreparedScene prepared;
  const Scene& scene = prepared.scene();
  TransportContext context = prepared.context();
  explicit World(const SceneMaker& maker) : prepared(maker.scene) {}
};

std::vector<PathSample> samples_along(const Ray& ray, int count, std::uint64_t seed = 1) {
  std::vector<PathSample> paths;
  for (int i = 0; i < count; ++i)
    paths.push_back({ray, Rng(seed, RngPurpose::test, static_cast<std::uint64_t>(i)), {}, {}});
  return paths;
}

struct Estimate {
  Vec3d mean{0, 0, 0};
  Vec3d error{0, 0, 0};  // standard error of the mean
};

Estimate estimate(const TransportContext& context, const Ray& ray, int count, const PathLimits& limits) {
  std::vector<PathSample> paths = samples_along(ray, count);
  PathCounters counters;
  trace_paths(context, limits, paths, counters);
  Estimate e;
  Vec3d square{0, 0, 0};
  for (const PathSample& p : paths) {
    e.mean += Vec3d(p.radiance) / static_cast<double>(count);
    square += Vec3d(p.radiance) * Vec3d(p.radiance) / static_cast<double>(count);
  }
  for (int c = 0; c < 3; ++c) e.error[c] = std::sqrt(std::max(0.0, square[c] - e.mean[c] * e.mean[c]) / count);
  return e;
}

// Inside a sphere that emits 1 and reflects a everywhere, all light is 1 + a + a^2 + ... : depth counts the terms.
TEST(Path, FurnaceCountsDepthAsMitsuba) {
  SceneMaker maker;
  maker.sphere({0.3f, 0.2f, 0.1f}, 2.0f, maker.diffuse(Vec3f(0.5f, 0.8f, 0.2f)), Vec3f(1.0f), true);
  const World world(maker);
  const Ray ray{{0.5f, 0.4f, 0.0f}, normalize(Vec3f(1, 2, 3)), 1e30f};
  EXPECT_EQ(estimate(world.context, ray, 10, {0, 5}).mean.y, 0.0);
  EXPECT_NEAR(estimate(world.context, ray, 10, {1, 5}).mean.y, 1.0, 1e-6);
  for (const int depth : {2, 3, 4, 7}) {
    double expected = 0.0;
    for (int i = depth - 1; i >= 0; --i) expected = 1.0 + 0.8 * expected;
    const Estimate e = estimate(world.context, ray, 20000, {depth, 100});
    // No noise here. 1e-4 of the light gets lost as rays start beside the surface.
    EXPECT_NEAR(e.mean.y, expected, 4.0 * e.error.y + 2e-4 * expected) << depth;
  }
  for (const int rr_depth : {1, 5}) {
    const Estimate e = estimate(world.context, ray, 40000, {-1, rr_depth});
    const Vec3d expected(2.0, 5.0, 1.25);
    for (int c = 0; c < 3; ++c)
      EXPECT_NEAR(e.mean[c], expected[c], 4.0 * e.error[c] + 2e-4 * expected[c]) << rr_depth << " " << c;
  }
}

// An object that absorbs nothing in an environment of radiance 1 everywhere cannot be seen.
TEST(Path, LosslessObjectsVanishInTheFurnace) {
  for (int kind = 0; kind < 6; ++kind) {
    SceneMaker maker;
    Environment e;
    e.width = e.height = 8;
    e.pixels.assign(64, Vec3f(1.0f));
    maker.scene.environments.push_back(e);
    Material m;
    m.reflectance = maker.texture(1.0f);
    m.specular_reflectance = m.specular_transmittance = maker.texture(1.0f);
    if (kind == 1) m.type = BsdfType::conductor;
    if (kind == 2) m.type = BsdfType::dielectric;
    if (kind == 3) m.type = BsdfType::thindielectric;
    if (kind == 4) m.opacity = maker.texture(0.4f);
    if (kind == 4) m.two_sided = true;
    if (kind == 5) {
      m.type = BsdfType::roughconductor;  // single scattering loses a little: at this roughness less than 1 %
      m.alpha_u = maker.texture(0.05f);
    }
    maker.sphere({0, 0, 5}, 1.0f, maker.material(m));
    const World world(maker);
    const Estimate centre =
        estimate(world.context, {{0, 0, 0}, normalize(Vec3f(0.05f, 0.03f, 1.0f)), 1e30f}, 20000, {-1, 50});
    const Estimate rim =
        estimate(world.context, {{0, 0, 0}, normalize(Vec3f(0.19f, 0.0f, 1.0f)), 1e30f}, 20000, {-1, 50});
    const double tolerance = kind == 5 ? 0.01 : 4.0 * centre.error.y + 2e-4;
    EXPECT_NEAR(centre.mean.y, 1.0, tolerance) << kind;
    EXPECT_NEAR(rim.mean.y, 1.0, kind == 5 ? 0.02 : 4.0 * rim.error.y + 2e-4) << kind;
  }
}

// A lamp a centimetre above a floor, several units from the origin: the shadow ray must end before the lamp.
TEST(Path, CloseLampsLightWhatIsUnderThem) {
  for (const float height : {0.01f, 0.1f}) {
    SceneMaker maker;
    const int grey = maker.diffuse(Vec3f(0.5f), true);
    const Vec3f at{3.0f, 1.0f, -4.0f};
    const float a = 2.0f * height;
    maker.quad(at + Vec3f(-9, 0, 9), {18, 0, 0}, {0, 0, -18}, grey);
    maker.quad(at + Vec3f(-a, height, -a), {2 * a, 0, 0}, {0, 0, 2 * a}, grey, Vec3f(1.0f));
    const World world(maker);
    // Look at the point under the lamp's middle from the side, below the lamp's rim.
    const Vec3f eye = at + Vec3f(4.0f * height, 0.5f * height, 0.0f);
    const double x = 2.0, r = std::sqrt(1.0 + x * x);
    const double factor = 4.0 / (2.0 * 3.14159265358979) * (2.0 * x / r * std::atan(x / r));
    const Estimate e = estimate(world.context, {eye, normalize(at - eye), 1e30f}, 20000, {2, 5});
    EXPECT_NEAR(e.mean.y, 0.5 * factor, 4.0 * e.error.y + 5e-3 * factor) << height;
  }
}

SceneMaker box_with_everything() {
  SceneMaker maker;
  const int white = maker.diffuse(Vec3f(0.7f), true);
  Material glass, mirror, mask, glossy;
  glass.type = BsdfType::dielectric;
  mirror.type = BsdfType::conductor;
  mask.reflectance = maker.texture(0.3f);
  mask.opacity = maker.texture(0.5f);
  mask.two_sided = true;
  glossy.type = BsdfType::roughplastic;
  glossy.reflectance = maker.texture(Vec3f(0.5f, 0.2f, 0.1f));
  glossy.alpha_u = maker.texture(0.1f);
  glossy.two_sided = true;
  maker.quad({-2, 0, 2}, {4, 0, 0}, {0, 0, -4}, maker.material(glossy));
  maker.quad({-2, 0, -2}, {4, 0, 0}, {0, 3, 0}, white);
  maker.quad({-2, 0, 2}, {0, 0, -4}, {0, 3, 0}, white);
  maker.quad({-0.5f, 2.9f, -0.5f}, {1, 0, 0}, {0, 0, 1}, white, Vec3f(8.0f));
  maker.sphere({-0.7f, 0.6f, -0.5f}, 0.6f, maker.material(glass));
  maker.sphere({0.8f, 0.6f, -0.8f}, 0.6f, maker.material(mirror));
  maker.quad({-1, 0.2f, 1}, {2, 0, 0}, {0, 1.5f, 0}, maker.material(mask));
  Environment e;
  e.width = 4;
  e.height = 3;
  for (int i = 0; i < 12; ++i) e.pixels.push_back(Vec3f(0.1f + 0.05f * static_cast<float>(i % 5)));
  maker.scene.environments.push_back(e);
  return maker;
}

// A path does not know which others walk beside it.
TEST(Path, GroupsDoNotChangeResults) {
  const World world(box_with_everything());
  const Ray ray{{0.0f, 1.2f, 4.0f}, normalize(Vec3f(0.02f, -0.1f, -1.0f)), 1e30f};
  std::vector<PathSample> together = samples_along(ray, 203), alone = samples_along(ray, 203);
  PathCounters a, b;
  trace_paths(world.context, {8, 5}, together, a);
  for (PathSample& p : alone) trace_paths(world.context, {8, 5}, std::span(&p, 1), b);
  // Packets of rays may round differently: rarely, a path then takes another turn.
  int same = 0;
  for (std::size_t i = 0; i < together.size(); ++i) {
    same += length(together[i].radiance - alone[i].radiance) <= 1e-3f * length(alone[i].radiance);
    EXPECT_NEAR(together[i].first.depth, alone[i].first.depth, 1e-3f);
  }
  EXPECT_GE(same, 200);
  EXPECT_NEAR(static_cast<double>(a.rays), static_cast<double>(b.rays), 20.0);
  EXPECT_GT(a.rays, 203);
}

TEST(Path, FirstHitAttributesLookThroughMasks) {
  SceneMaker maker;
  Material mask;
  mask.reflectance = maker.texture(0.3f);
  mask.opacity = maker.texture(0.25f);
  mask.two_sided = true;
  Material metal;
  metal.type = BsdfType::roughconductor;
  metal.alpha_u = maker.texture(0.2f);
  metal.specular_reflectance = maker.texture(0.9f);
  maker.quad({-1, -1, 2}, {2, 0, 0}, {0, 2, 0}, maker.material(mask));
  maker.quad({-1, 1, 5}, {2, 0, 0}, {0, -2, 0}, maker.material(metal));
  const World world(maker);
  std::vector<PathSample> paths = samples_along({{0.1f, 0.1f, 0.0f}, {0, 0, 1}, 1e30f}, 4000);
  PathCounters counters;
  trace_paths(world.context, {1, 5}, paths, counters);
  int ended = 0;
  for (const PathSample& p : paths) {
    if (!p.first.valid) continue;  // depth 1 ends at the mask
    ++ended;
    EXPECT_NEAR(p.first.depth, 2.0f, 1e-5f);
    EXPECT_FLOAT_EQ(p.first.roughness, 1.0f);
  }
  EXPECT_NEAR(ended / 4000.0, 0.25, 0.03);
  paths = samples_along({{0.1f, 0.1f, 0.0f}, {0, 0, 1}, 1e30f}, 4000);
  trace_paths(world.context, {3, 5}, paths, counters);
  int front = 0;
  for (const PathSample& p : paths) {
    ASSERT_TRUE(p.first.valid);
    const bool on_mask = p.first.depth < 3.0f;
    front += on_mask;
    EXPECT_NEAR(p.first.depth, on_mask ? 2.0f : 5.0f, 1e-3f);
    EXPECT_EQ(p.first.albedo, on_mask ? Vec3f(0.3f) : Vec3f(0.9f));
    EXPECT_FLOAT_EQ(p.first.roughness, on_mask ? 1.0f : 0.2f);
    EXPECT_LT(p.first.normal.z, -0.99f);
  }
  EXPECT_NEAR(front / 4000.0, 0.25, 0.03);
}

// What Mitsuba 3.9.1 makes of it (`hide_emitters`): the camera sees what lies behind the lamp, lit by it; nothing where
// only the sky is; masks show the lamp, and light on what is seen through them counts.
TEST(Path, HiddenEmitters) {
  SceneMaker maker;
  const int grey = maker.diffuse(Vec3f(0.5f), true);
  Material curtain;
  curtain.reflectance = maker.texture(0.3f);
  curtain.opacity = maker.texture(0.5f);
  curtain.two_sided = true;
  maker.quad({-1, -1, 1}, {2, 0, 0}, {0, 2, 0}, grey, Vec3f(4.0f));
  maker.quad({-3, -3, 2}, {6, 0, 0}, {0, 6, 0}, grey);
  maker.quad({3, 0, 0.5f}, {0.5f, 0, 0}, {0, 0.5f, 0}, maker.material(curtain));
  Environment sky;
  sky.width = sky.height = 2;
  sky.pixels.assign(4, Vec3f(0.25f));
  maker.scene.environments.push_back(sky);
  maker.scene.hide_emitters = true;
  const World hiding(maker);
  maker.scene.hide_emitters = false;
  const World showing(maker);
  const PathLimits limits{-1, 5};

  const Vec3f down{0, 0, 1};
  PathCounters counters;
  std::vector<PathSample> behind = samples_along({{0.1f, 0.2f, 0}, down, 1e30f}, 2000);
  trace_paths(hiding.context, limits, behind, counters);
  const Vec3d expected = estimate(showing.context, {{0.1f, 0.2f, 1.5f}, down, 1e30f}, 2000, limits).mean;
  Vec3d mean{0, 0, 0};
  for (const PathSample& p : behind) {
    mean += Vec3d(p.radiance) / 2000.0;
    EXPECT_NEAR(p.first.depth, 2.0f, 1e-5f);
  }
  EXPECT_GT(mean.y, 0.5);
  EXPECT_NEAR(mean.y, expected.y, 1e-6);

  EXPECT_EQ(estimate(hiding.context, {{0, 0, 0}, {0, 0, -1}, 1e30f}, 100, limits).mean.y, 0.0);
  EXPECT_NEAR(estimate(showing.context, {{0, 0, 0}, {0, 0, -1}, 1e30f}, 100, limits).mean.y, 0.25, 1e-6);

  // Through the curtain alone there is no sky; what the curtain reflects is there.
  const Ray up{{3.2f, 0.2f, 0.7f}, {0, 0, -1}, 1e30f};
  std::vector<PathSample> hidden = samples_along(up, 2000), shown = hidden;
  trace_paths(hiding.context, limits, hidden, counters);
  trace_paths(showing.context, limits, shown, counters);
  int through = 0;
  for (std::size_t i = 0; i < hidden.size(); ++i) {
    through += hidden[i].first.valid ? 0 : 1;
    EXPECT_NEAR(hidden[i].radiance.y + (hidden[i].first.valid ? 0.0f : 0.25f), shown[i].radiance.y, 1e-5f);
  }
  EXPECT_NEAR(through, 1000, 120);
}

TEST(Path, BacksOfOneSidedSurfacesAreBlack) {
  SceneMaker maker;
  maker.quad({-1, -1, 2}, {2, 0, 0}, {0, 2, 0}, maker.diffuse(Vec3f(0.8f)),
             Vec3f(3.0f));  // faces +z, away from the eye
  const World world(maker);
  const Estimate e = estimate(world.context, {{0, 0, 0}, {0, 0, 1}, 1e30f}, 100, {-1, 5});
  EXPECT_EQ(e.mean.y, 0.0);
  const Estimate other = estimate(world.context, {{0, 0, 4}, {0, 0, -1}, 1e30f}, 100, {-1, 5});
  EXPECT_NEAR(other.mean.y, 3.0, 1e-9);
}

}  // namespace
}  // namespace octrad
