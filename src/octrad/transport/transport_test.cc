// The right-hand-side estimator against furnaces whose answer is known, and the properties of left-hand-side points.
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>

#include "octrad/base/threads.h"
#include "octrad/scene/load.h"
#include "octrad/transport/lhs_sampler.h"
#include "octrad/transport/rhs_estimator.h"

namespace octrad {
namespace {

// A closed cube of side 2 seen from inside; `material` and `emitter` are XML inside the shape.
Scene furnace(const std::string& material, const std::string& emitter, const std::string& more = "") {
  const auto file = std::filesystem::temp_directory_path() / ("octrad_furnace_" + std::to_string(::getpid()) + ".xml");
  std::ofstream(file)
      << R"(<scene version="3.0.0"><sensor type="perspective"><film type="hdrfilm"><integer name="width" value="16"/>
    <integer name="height" value="16"/></film></sensor><shape type="cube"><boolean name="flip_normals" value="true"/>)"
      << material << emitter << "</shape>" << more << "</scene>";
  Scene scene = load_scene(file.string());
  std::filesystem::remove(file);
  return scene;
}

struct TestScene {
  PreparedScene prepared;
  const Scene& scene = prepared.scene();
  TransportContext context = prepared.context();
  explicit TestScene(Scene s) : prepared(std::move(s)) {}
};

const std::string kGrey = R"(<bsdf type="diffuse"><rgb name="reflectance" value="0.5"/></bsdf>)";
const std::string kGlow = R"(<emitter type="area"><rgb name="radiance" value="1"/></emitter>)";

struct Mean {
  double value = 0.0, error = 0.0;  // standard error
};

// Of the red channel.
Mean mean(const std::vector<Vec3f>& values) {
  const auto n = static_cast<double>(values.size());
  double sum = 0.0, squares = 0.0;
  for (const Vec3f& v : values) {
    sum += static_cast<double>(v.x);
    squares += static_cast<double>(v.x) * static_cast<double>(v.x);
  }
  return {sum / n, std::sqrt(std::max(0.0, squares / n - sum / n * sum / n) / n)};
}

// Within 4 standard errors, and what float arithmetic loses.
void expect_mean(const std::vector<Vec3f>& values, double expected) {
  const Mean found = mean(values);
  EXPECT_LT(found.error, 0.01 * expected) << "too noisy to see anything";
  EXPECT_NEAR(found.value, expected, 4.0 * found.error + 1e-5 * expected);
}

std::vector<ShadingPoint> area_points(const TestScene& setup, std::size_t n) {
  LhsOptions options;
  options.walks = 0.0;
  std::vector<ShadingPoint> points(n);
  LhsSampler(setup.prepared, options).sample(0, points);
  return points;
}

TEST(RhsEstimator, ConstantCacheInAGreyBoxIsReflectedExactly) {
  const TestScene setup(furnace(kGrey, ""));
  const auto points = area_points(setup, 64);
  std::vector<Vec3f> targets(points.size());
  RhsOptions options;
  const auto statistics = estimate_rhs(
      setup.context, points, options,
      [](std::span<const SurfacePoint> asked, std::span<Vec3f> out) {
        for (std::size_t i = 0; i < asked.size(); ++i) out[i] = Vec3f(2.0f, 4.0f, 6.0f);
      },
      targets);
  EXPECT_EQ(statistics.queries, 64 * 16);
  for (const Vec3f& t : targets) {
    EXPECT_NEAR(t.x, 1.0f, 1e-4f);
    EXPECT_NEAR(t.z, 3.0f, 1e-4f);
  }
}

TEST(RhsEstimator, GlowingBoxGivesAlbedoTimesEmission) {
  const TestScene setup(furnace(kGrey, kGlow));
  const auto points = area_points(setup, 512);
  std::vector<Vec3f> targets(points.size());
  RhsOptions options;
  options.directions = 64;
  estimate_rhs(setup.context, points, options, nullptr, targets);
  expect_mean(targets, 0.5);  // emitter and BSDF sampling together count every direction once
}

TEST(RhsEstimator, LampsReflectToo) {
  // Every wall emits 1 and, says the cache, reflects 2: 0.5 (1 + 2) arrives whether the cache's answer holds the
  // emission or not.
  const TestScene setup(furnace(kGrey, kGlow));
  const auto points = area_points(setup, 512);
  std::vector<Vec3f> targets(points.size());
  for (const bool inside : {false, true}) {
    RhsOptions options;
    options.directions = 64;
    options.emission_inside = inside;
    const auto cache = [inside](std::span<const SurfacePoint> asked, std::span<Vec3f> out) {
      for (std::size_t i = 0; i < asked.size(); ++i) out[i] = Vec3f(inside ? 3.0f : 2.0f);
    };
    estimate_rhs(setup.context, points, options, cache, targets);
    SCOPED_TRACE(inside);
    expect_mean(targets, 1.5);
  }
  // An untrained cache, which knows nothing of the emission, takes away no light that was sampled.
  RhsOptions options;
  options.directions = 64;
  options.emission_inside = true;
  estimate_rhs(
      setup.context, points, options,
      [](std::span<const SurfacePoint> asked, std::span<Vec3f> out) {
        std::fill_n(out.begin(), asked.size(), Vec3f(0.0f));
      },
      targets);
  expect_mean(targets, 0.5);
}

TEST(FollowRay, EmissionOfTheEndIsToldFromWhatWasPassed) {
  // Two lamps above the origin, the nearer one behind a mask that lets everything pass.
  const TestScene setup(furnace(
      kGrey, "",
      R"(<shape type="rectangle"><transform name="to_world"><rotate x="1" angle="180"/><translate z="0.3"/></transform>
    <bsdf type="mask"><float name="opacity" value="0"/><bsdf type="diffuse"/></bsdf><emitter type="area"><rgb name="radiance" value="2"/></emitter></shape>
    <shape type="rectangle"><transform name="to_world"><rotate x="1" angle="180"/><translate z="0.6"/></transform>
    <emitter type="area"><rgb name="radiance" value="5"/></emitter></shape>)"));
  Rng rng(1, RngPurpose::test, 0);
  const RayEnd end =
      follow_ray(setup.context, Vec3f(0.1f, 0.2f, 0.0f), nullptr, Vec3f(0.0f, 0.0f, 1.0f), rng, false, 16);
  ASSERT_TRUE(end.surface);
  EXPECT_FLOAT_EQ(end.first_emitted.x + end.emitted.x, 7.0f);
  EXPECT_FLOAT_EQ(end.passed_emitted.x, 2.0f);
  EXPECT_FLOAT_EQ(end.own_emitted.x, 5.0f);
}

TEST(RhsEstimator, RoughConductorFurnaceReflectsAtMostWhatArrives) {
  const TestScene setup(furnace(
      R"(<bsdf type="roughconductor"><string name="material" value="none"/><float name="alpha" value="0.1"/></bsdf>)",
      kGlow));
  const auto points = area_points(setup, 512);
  std::vector<Vec3f> targets(points.size());
  RhsOptions options;
  options.directions = 32;
  estimate_rhs(setup.context, points, options, nullptr, targets);
  const Mean found = mean(targets);  // single scattering loses a little
  EXPECT_GT(found.value, 0.9);
  EXPECT_LT(found.value, 1.0 + 4.0 * found.error);
}

TEST(RhsEstimator, MirrorChainsReachTheCacheBehindThem) {
  // A small perfect mirror sphere in the box: its own target is what the chain finds, here the constant cache.
  const TestScene setup(furnace(
      kGrey, "", R"(<shape type="sphere"><float name="radius" value="0.3"/><point name="center" x="0.4" y="0" z="0"/>
    <bsdf type="conductor"><string name="material" value="none"/></bsdf></shape>)"));
  const auto points = area_points(setup, 2048);
  std::vector<Vec3f> targets(points.size());
  RhsOptions options;
  estimate_rhs(
      setup.context, points, options,
      [](std::span<const SurfacePoint> asked, std::span<Vec3f> out) {
        for (std::size_t i = 0; i < asked.size(); ++i) {
          EXPECT_FLOAT_EQ(asked[i].alpha, 1.0f);  // only the grey box is asked: chains pass the mirror
          out[i] = Vec3f(1.0f);
        }
      },
      targets);
  int mirrors = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const bool mirror = is_delta(points[i].bsdf);
    mirrors += mirror;
    EXPECT_NEAR(targets[i].y, mirror ? 1.0f : 0.5f, 1e-3f);
  }
  EXPECT_GT(mirrors, 20);
}

TEST(RhsEstimator, SameBitsAtAnyThreadCount) {
  const TestScene setup(furnace(kGrey, kGlow));
  const auto points = area_points(setup, 256);
  std::vector<Vec3f> one(points.size()), two(points.size());
  set_thread_count(1);
  estimate_rhs(setup.context, points, {}, nullptr, one);
  set_thread_count(3);
  estimate_rhs(setup.context, points, {}, nullptr, two);
  set_thread_count(0);
  EXPECT_TRUE(one == two);
}

TEST(LhsSampler, PointsLieOnSurfacesWithTheViewerOnTheirSide) {
  const TestScene setup(furnace(kGrey, "", R"(<shape type="sphere"><float name="radius" value="0.3"/></shape>)"));
  for (const double keep : {0.0, 1.0}) {
    LhsOptions options;
    options.keep_direction = keep;
    options.poses = keep > 0.0 ? 16 : 0;
    const LhsSampler sampler(setup.prepared, options);
    EXPECT_EQ(sampler.poses().size(), keep > 0.0 ? 16u : 1u);
    std::vector<ShadingPoint> points(1000), again(1000);
    sampler.sample(7, points);
    sampler.sample(7, again);
    for (std::size_t i = 0; i < points.size(); ++i) {
      const SurfacePoint p = surface_point(points[i]);
      EXPECT_FALSE(points[i].black);
      EXPECT_GE(dot(p.n, p.wo), 0.0f);
      EXPECT_NEAR(length(p.wo), 1.0f, 1e-4f);
      EXPECT_LE(max_component(max(p.x, -p.x)), 1.0f + 1e-4f);
      EXPECT_TRUE(p.x == again[i].surface.position);
    }
  }
}

TEST(LhsSampler, GlossyPointsCanBeFavouredAndSeenUniformly) {
  const TestScene setup(furnace(
      kGrey, "",
      R"(<shape type="sphere"><float name="radius" value="0.6"/><bsdf type="roughconductor"><float name="alpha" value="0.1"/></bsdf></shape>)"));
  const auto glossy = [&](double boost, bool uniform) {
    LhsOptions options;
    options.walks = 0.0;
    options.glossy_boost = boost;
    options.uniform_glossy = uniform;
    std::vector<ShadingPoint> points(6000);
    LhsSampler(setup.prepared, options).sample(1, points);
    double count = 0.0, cosine = 0.0;
    for (const ShadingPoint& p : points) {
      if (roughness(p.bsdf) >= 0.5f) continue;
      count += 1.0;
      cosine += static_cast<double>(dot(p.ns, p.wo));
    }
    return std::pair{count / 6000.0, cosine / count};
  };
  // The sphere's outside against the box's inside, by area (samples on the black side of either are drawn again).
  const double share = 4.0 * 3.14159265 * 0.36 / (4.0 * 3.14159265 * 0.36 + 24.0);
  const auto [plain, mean_cosine] = glossy(1.0, false);
  // 5 standard deviations; a cosine of density 2 c has variance 1 / 18, a uniform one 1 / 12.
  const auto share_error = [](double p) { return 5.0 * std::sqrt(p * (1.0 - p) / 6000.0); };
  EXPECT_NEAR(plain, share, share_error(share));
  EXPECT_NEAR(mean_cosine, 2.0 / 3.0, 5.0 * std::sqrt(1.0 / 18.0 / (6000.0 * plain)));
  const auto [boosted, mean_uniform] = glossy(3.0, true);
  const double boosted_share = 3.0 * share / (3.0 * share + 1.0 - share);
  EXPECT_NEAR(boosted, boosted_share, share_error(boosted_share));
  EXPECT_NEAR(mean_uniform, 0.5, 5.0 * std::sqrt(1.0 / 12.0 / (6000.0 * boosted)));
}

TEST(LhsSampler, AreaPointsAreUniform) {
  const TestScene setup(furnace(kGrey, ""));
  const auto points = area_points(setup, 12000);
  int faces[6] = {};
  for (const ShadingPoint& p : points) {
    for (int a = 0; a < 3; ++a) {
      if (p.surface.position[a] > 0.9999f) ++faces[2 * a];
      if (p.surface.position[a] < -0.9999f) ++faces[2 * a + 1];
    }
  }
  for (const int f : faces) EXPECT_NEAR(f, 2000, 5 * 41);  // 5 standard deviations
}

}  // namespace
}  // namespace octrad
