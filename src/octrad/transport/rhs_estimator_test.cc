// The right-hand-side estimator against furnaces whose answer is known.
#include <gtest/gtest.h>

#include <algorithm>

#include "octrad/base/threads.h"
#include "octrad/transport/furnace_test_helper.h"
#include "octrad/transport/lhs_sampler.h"
#include "octrad/transport/mean_test_helper.h"
#include "octrad/transport/rhs_estimator.h"

namespace octrad {
namespace {

using testing::furnace;
using testing::FurnaceScene;
using testing::kGlow;
using testing::kGrey;

// Within 4 standard errors, and what float arithmetic loses.
void expect_mean(const std::vector<Vec3f>& values, double expected) {
  const testing::Mean found = testing::mean(values);
  EXPECT_LT(found.error, 0.01 * expected) << "too noisy to see anything";
  EXPECT_NEAR(found.value, expected, 4.0 * found.error + 1e-5 * expected);
}

std::vector<ShadingPoint> area_points(const FurnaceScene& setup, std::size_t n) {
  LhsOptions options;
  options.walks = 0.0;
  std::vector<ShadingPoint> points(n);
  LhsSampler(setup.prepared, options).sample(0, points);
  return points;
}

TEST(RhsEstimator, ConstantCacheInAGreyBoxIsReflectedExactly) {
  const FurnaceScene setup(furnace(kGrey, ""));
  const auto points = area_points(setup, 64);
  std::vector<Vec3f> targets(points.size());
  RhsOptions options;
  const auto counts = estimate_rhs(
      setup.context, points, options,
      [](std::span<const SurfacePoint> asked, std::span<Vec3f> out) {
        for (std::size_t i = 0; i < asked.size(); ++i) out[i] = Vec3f(2.0f, 4.0f, 6.0f);
      },
      targets);
  EXPECT_EQ(counts.queries, 64u * 16u);
  for (const Vec3f& t : targets) {
    EXPECT_NEAR(t.x, 1.0f, 1e-4f);
    EXPECT_NEAR(t.z, 3.0f, 1e-4f);
  }
}

TEST(RhsEstimator, GlowingBoxGivesAlbedoTimesEmission) {
  const FurnaceScene setup(furnace(kGrey, kGlow));
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
  const FurnaceScene setup(furnace(kGrey, kGlow));
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
  // A noisy cache whose answers are below the emission half of the time, and right in the mean: no light is added.
  RhsOptions options;
  options.directions = 64;
  options.emission_inside = true;
  estimate_rhs(
      setup.context, points, options,
      [](std::span<const SurfacePoint> asked, std::span<Vec3f> out) {
        for (std::size_t i = 0; i < asked.size(); ++i) out[i] = Vec3f(i % 2 == 0 ? 0.2f : 5.8f);
      },
      targets);
  expect_mean(targets, 1.5);
  // An untrained cache, which knows nothing of the emission, takes away no light that was sampled.
  estimate_rhs(
      setup.context, points, options,
      [](std::span<const SurfacePoint> asked, std::span<Vec3f> out) {
        std::fill_n(out.begin(), asked.size(), Vec3f(0.0f));
      },
      targets);
  expect_mean(targets, 0.5);
}

TEST(RhsEstimator, RoughConductorFurnaceReflectsAtMostWhatArrives) {
  const FurnaceScene setup(furnace(
      R"(<bsdf type="roughconductor"><string name="material" value="none"/><float name="alpha" value="0.1"/></bsdf>)",
      kGlow));
  const auto points = area_points(setup, 512);
  std::vector<Vec3f> targets(points.size());
  RhsOptions options;
  options.directions = 32;
  estimate_rhs(setup.context, points, options, nullptr, targets);
  const testing::Mean found = testing::mean(targets);  // single scattering loses a little
  EXPECT_GT(found.value, 0.9);
  EXPECT_LT(found.value, 1.0 + 4.0 * found.error);
}

TEST(RhsEstimator, MirrorChainsReachTheCacheBehindThem) {
  // A small perfect mirror sphere in the box: its own target is what the chain finds, here the constant cache.
  const FurnaceScene setup(furnace(
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
    const bool mirror = is_delta_bsdf(points[i].bsdf);
    mirrors += mirror;
    EXPECT_NEAR(targets[i].y, mirror ? 1.0f : 0.5f, 1e-3f);
  }
  EXPECT_GT(mirrors, 20);
}

// One of two lobes is asked for at the end of a ray, and counts for both.
TEST(RhsEstimator, LobesOfCoatsAddUp) {
  const FurnaceScene setup(furnace(
      kGrey, "", R"(<shape type="sphere"><float name="radius" value="0.6"/><point name="center" x="0.3" y="0.2" z="0"/>
    <bsdf type="roughplastic"><float name="alpha" value="0.2"/><rgb name="diffuse_reflectance" value="0.1,0,0.7"/></bsdf></shape>)"));
  std::vector<ShadingPoint> points = area_points(setup, 64);
  RhsOptions options;
  options.directions = 4096;
  const auto target = [&](bool split) {
    std::vector<Vec3f> targets(points.size());
    options.split_coats = split;
    int lobes[3] = {0, 0, 0};
    estimate_rhs_serial(
        setup.context, points, options,
        [&](std::span<const SurfacePoint> asked, std::span<Vec3f> out) {
          for (std::size_t i = 0; i < asked.size(); ++i) {
            const float alpha = asked[i].alpha;
            const bool coated = asked[i].x.x * asked[i].x.x < 0.9f && length(asked[i].x - Vec3f(0.3f, 0.2f, 0)) < 0.61f;
            ++lobes[!coated ? 0 : alpha == 1.0f ? 1 : 2];
            EXPECT_EQ(coated && split && alpha == 1.0f, coated && split && alpha != 0.2f);
            out[i] = coated && !split ? Vec3f(3.0f) : coated ? Vec3f(alpha == 1.0f ? 1.0f : 2.0f) : Vec3f(0.5f);
          }
        },
        targets);
    EXPECT_EQ(lobes[1] > 1000, split);
    EXPECT_GT(lobes[2], 1000);
    return targets;
  };
  const std::vector<Vec3f> whole = target(false), split = target(true);
  double a = 0.0, b = 0.0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    a += static_cast<double>(whole[i].y);
    b += static_cast<double>(split[i].y);
  }
  EXPECT_NEAR(b / a, 1.0, 0.01);
}

TEST(RhsEstimator, SameBitsAtAnyThreadCount) {
  const FurnaceScene setup(furnace(kGrey, kGlow));
  const auto points = area_points(setup, 256);
  std::vector<Vec3f> one(points.size()), two(points.size());
  set_thread_count(1);
  estimate_rhs(setup.context, points, {}, nullptr, one);
  set_thread_count(3);
  estimate_rhs(setup.context, points, {}, nullptr, two);
  set_thread_count(0);
  EXPECT_TRUE(one == two);
}

}  // namespace
}  // namespace octrad
