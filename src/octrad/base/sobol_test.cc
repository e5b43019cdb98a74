#include "octrad/base/sobol_math.h"

#include <cmath>
#include <set>

#include <gtest/gtest.h>

namespace octrad {
namespace {

TEST(Sobol, EveryElementaryIntervalOfTheFirstTwoDimensionsHoldsOnePoint) {
  for (int columns = 0; columns <= 8; ++columns) {
    std::set<std::uint32_t> boxes;
    for (std::uint32_t i = 0; i < 256; ++i) {
      std::uint32_t f[3];
      sobol3(i, f);
      const std::uint32_t x = columns > 0 ? f[0] >> (32 - columns) : 0, y = columns < 8 ? f[1] >> (24 + columns) : 0;
      boxes.insert(x << (8 - columns) | y);
    }
    EXPECT_EQ(boxes.size(), 256u) << columns << " bits of x";
  }
}

TEST(Sobol, EachDimensionIsStratified) {
  for (int d = 0; d < 3; ++d) {
    std::set<std::uint32_t> strata;
    for (std::uint32_t i = 0; i < 4096; ++i) {
      std::uint32_t f[3];
      sobol3(i, f);
      strata.insert(f[d] >> 20);
    }
    EXPECT_EQ(strata.size(), 4096u) << "dimension " << d;
  }
}

TEST(SobolSet, EveryPointIsUniformOverSets) {
  const int n = 20000;
  for (const std::uint32_t index : {0u, 5u}) {
    double mean[3] = {}, square[3] = {}, product = 0.0;
    for (int s = 0; s < n; ++s) {
      Rng rng(1, RngPurpose::test, static_cast<std::uint64_t>(s));
      const SobolSet::Sample u = SobolSet(rng)(index);
      const double v[3] = {u.u2.x, u.u2.y, u.u1};
      for (int d = 0; d < 3; ++d) {
        ASSERT_GE(v[d], 0.0);
        ASSERT_LT(v[d], 1.0);
        mean[d] += v[d] / n;
        square[d] += v[d] * v[d] / n;
      }
      product += (v[0] - 0.5) * (v[1] - 0.5) / n;
    }
    const double sigma = 1.0 / std::sqrt(12.0 * n);
    for (int d = 0; d < 3; ++d) {
      EXPECT_NEAR(mean[d], 0.5, 5.0 * sigma);
      EXPECT_NEAR(square[d], 1.0 / 3.0, 5.0 * sigma * 1.1);
    }
    EXPECT_NEAR(product, 0.0, 5.0 / (12.0 * std::sqrt(double(n))));
  }
}

// What the estimator gains: the mean of 16 points of a set against 16 independent ones, on a smooth integrand.
TEST(SobolSet, SixteenPointsHaveFarLessVarianceThanIndependentOnes) {
  const auto f = [](Vec2f u) { return double(u.x) * u.y + std::sin(3.0 * u.x); };
  double variance[2] = {}, mean[2] = {};
  const int n = 2000;
  for (int s = 0; s < n; ++s) {
    Rng rng(2, RngPurpose::test, static_cast<std::uint64_t>(s));
    const SobolSet set(rng);
    double sum[2] = {};
    for (std::uint32_t i = 0; i < 16; ++i) {
      sum[0] += f(set(i).u2) / 16.0;
      sum[1] += f(rng.uniform2()) / 16.0;
    }
    for (int k = 0; k < 2; ++k) {
      mean[k] += sum[k] / n;
      variance[k] += sum[k] * sum[k] / n;
    }
  }
  const double exact = 0.25 + (1.0 - std::cos(3.0)) / 3.0;
  for (int k = 0; k < 2; ++k) variance[k] -= mean[k] * mean[k];
  EXPECT_NEAR(mean[0], exact, 5.0 * std::sqrt(variance[0] / n));
  EXPECT_LT(variance[0], 0.1 * variance[1]);
}

}  // namespace
}  // namespace octrad
