// Far ends: which points keep one, how it is drawn, and that it is shaded as it was queried.
#include "octrad/transport/far_ends_math.h"

#include <gtest/gtest.h>

#include <cmath>
#include <set>

#include "octrad/transport/furnace_test_helper.h"
#include "octrad/transport/lhs_sampler.h"
#include "octrad/transport/rhs_estimator.h"

namespace octrad {
namespace {

using testing::furnace;
using testing::FurnaceScene;
using testing::kGrey;

TEST(FarEnds, EveryPlaceBelongsToOnePointAndStepsDiffer) {
  std::set<std::uint32_t> starts;
  for (unsigned long long step = 0; step < 20; ++step) {
    const FarEndRange range = far_end_range(step, 50, 15);
    starts.insert(range.first);
    std::set<std::uint32_t> places;
    for (std::uint32_t i = 0; i < 50; ++i) {
      if (const std::uint32_t place = range.place(i, 50); place < range.count) {
        EXPECT_TRUE(places.insert(place).second) << place << " twice";
      }
    }
    EXPECT_EQ(places.size(), 15u);
  }
  EXPECT_GT(starts.size(), 10u);
}

TEST(FarEnds, AreDrawnInProportionToTheirContribution) {
  const float weights[] = {0.5f, 0.0f, 3.0f, NAN, 1.5f};
  constexpr int kDraws = 20000;
  int chosen[5] = {};
  for (std::uint32_t point = 0; point < kDraws; ++point) {
    FarEndChoice choice(7, 3, point);
    int last = -1;
    for (int m = 0; m < 5; ++m)
      if (choice.take(Vec3f(weights[m]))) last = m;
    ASSERT_GE(last, 0);
    ++chosen[last];
  }
  EXPECT_EQ(chosen[1] + chosen[3], 0);
  for (const int m : {0, 2, 4}) {
    const double p = static_cast<double>(weights[m]) / 5.0, sigma = std::sqrt(kDraws * p * (1.0 - p));
    EXPECT_NEAR(chosen[m], kDraws * p, 4.5 * sigma) << m;
  }
}

// A room with a mask and a mirror in it; the cache answers x + 1, so that ends differ in weight.
TEST(FarEnds, AreTheQueriedPointsAndAnEmptyCacheKeepsNone) {
  const FurnaceScene setup(
      furnace(kGrey, "",
              R"(<shape type="sphere"><float name="radius" value="0.3"/><bsdf type="conductor"/></shape>
    <shape type="rectangle"><transform name="to_world"><scale value="0.5"/><translate z="0.6"/></transform>
    <bsdf type="mask"><float name="opacity" value="0.5"/><bsdf type="twosided"><bsdf type="diffuse"/></bsdf></bsdf></shape>)"));
  LhsOptions lhs;
  lhs.walks = 0.0;
  std::vector<ShadingPoint> points(64);
  LhsSampler(setup.prepared, lhs).sample(0, points);
  std::vector<Vec3f> targets(points.size());
  std::vector<FarEnd> ends(20);
  RhsOptions options;
  options.stream = 5;
  options.far_ends = ends;
  std::vector<SurfacePoint> asked;
  const auto query = [&](std::span<const SurfacePoint> queries, std::span<Vec3f> out) {
    for (std::size_t i = 0; i < queries.size(); ++i) out[i] = Vec3f(queries[i].x.x + 1.5f);
    asked.insert(asked.end(), queries.begin(), queries.end());
  };
  estimate_rhs_serial(setup.context, points, options, query, targets);
  for (const FarEnd& end : ends) {
    ASSERT_TRUE(end.hit.valid());
    const SurfacePoint point = surface_point(shade_far_end(setup.context, end));
    bool known = false;
    for (const SurfacePoint& q : asked)
      known = known || (q.x == point.x && q.n == point.n && q.wo == point.wo && q.albedo == point.albedo);
    EXPECT_TRUE(known) << "not a query of this batch";
  }
  // Keeping ends changes no target.
  std::vector<Vec3f> plain(points.size());
  options.far_ends = {};
  estimate_rhs_serial(setup.context, points, options, query, plain);
  EXPECT_TRUE(plain == targets);

  options.far_ends = ends;
  estimate_rhs_serial(
      setup.context, points, options,
      [](std::span<const SurfacePoint>, std::span<Vec3f> out) { std::fill(out.begin(), out.end(), Vec3f(0.0f)); },
      targets);
  for (const FarEnd& end : ends) EXPECT_FALSE(end.hit.valid());
}

}  // namespace
}  // namespace octrad
