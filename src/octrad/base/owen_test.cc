#include "octrad/base/owen_math.h"

#include <gtest/gtest.h>

#include <cmath>
#include <set>
#include <vector>

#include "octrad/base/rng.h"
#include "octrad/base/sobol_math.h"

namespace octrad {
namespace {

Rng pixel_sample(std::uint64_t pixel, std::uint32_t sample) {
  return Rng::of_sample(3, RngPurpose::test, pixel, sample);
}

TEST(Owen, SecondDimensionIsSobols) {
  for (std::uint32_t i = 0; i < 5000; ++i) {
    std::uint32_t fraction[3];
    sobol3(i * 859433u, fraction);
    ASSERT_EQ(reverse_bits(reversed_sobol2(i * 859433u)), fraction[1]);
    ASSERT_EQ(reverse_bits(i * 859433u), fraction[0]);
  }
}

TEST(Owen, ScramblingIsAPermutationThatKeepsPrefixes) {
  Rng rng(1, RngPurpose::test, 0);
  for (int s = 0; s < 50; ++s) {
    const std::uint32_t seed = rng.bits();
    std::set<std::uint32_t> low;
    for (std::uint32_t x = 0; x < 256; ++x) {
      const std::uint32_t to = scramble_upwards(x, seed);
      EXPECT_EQ(to & 255u, scramble_upwards(x | 0xabcdef00u, seed) & 255u);
      low.insert(to & 255u);
    }
    EXPECT_EQ(low.size(), 256u);
  }
}

// Any aligned block of 2^8 samples of any dimension: one in every elementary interval, by one and by two coordinates.
TEST(SampleRng, EveryElementaryIntervalHoldsOneSample) {
  for (const std::uint32_t first : {0u, 256u, 9u * 256u}) {
    for (int dimension = 0; dimension < 12; ++dimension) {
      std::set<std::uint32_t> boxes[9], strata;
      for (std::uint32_t sample = first; sample < first + 256; ++sample) {
        Rng rng = pixel_sample(7, sample), same = rng;
        for (int d = 0; d < dimension; ++d) rng.stratified(), same.stratified2();
        strata.insert(rng.stratified_bits() >> 24);
        const Vec2f u = same.stratified2();
        const auto x = static_cast<std::uint32_t>(u.x * 256.0f), y = static_cast<std::uint32_t>(u.y * 256.0f);
        for (int columns = 0; columns <= 8; ++columns)
          boxes[columns].insert((x >> (8 - columns)) << (8 - columns) | y >> columns);
      }
      EXPECT_EQ(strata.size(), 256u) << "dimension " << dimension;
      for (const auto& filled : boxes) EXPECT_EQ(filled.size(), 256u) << "dimension " << dimension;
    }
  }
}

// Over pixels, every number is uniform, and any two of a sample, or of two samples, do not depend on each other beyond
// what stratification asks for: two samples of a dimension repel each other, dimensions are independent.
TEST(SampleRng, NumbersAreUniformAndDimensionsIndependent) {
  constexpr int kPixels = 8000, kDimensions = 12;
  const double sigma = 1.0 / std::sqrt(12.0 * kPixels), product_sigma = 1.0 / (12.0 * std::sqrt(double(kPixels)));
  for (const std::uint32_t sample : {0u, 1u, 6u}) {
    std::vector<double> mean(kDimensions), square(kDimensions), next(kDimensions), bit(kDimensions),
        across(kDimensions);
    for (int p = 0; p < kPixels; ++p) {
      Rng rng = pixel_sample(static_cast<std::uint64_t>(p), sample);
      Rng other = pixel_sample(static_cast<std::uint64_t>(p), sample + 1);
      double before = 0.0;
      other.stratified();
      for (int d = 0; d < kDimensions; ++d) {
        const double u = rng.stratified(), of_next_dimension = other.stratified();
        mean[d] += u / kPixels;
        square[d] += u * u / kPixels;
        next[d] += (u - 0.5) * before / kPixels;
        bit[d] += (u < 0.5 ? 1.0 : -1.0) * (before < 0.0 ? 1.0 : -1.0) / kPixels;
        across[d] += (u - 0.5) * (of_next_dimension - 0.5) / kPixels;
        before = u - 0.5;
      }
    }
    for (int d = 0; d < kDimensions; ++d) {
      EXPECT_NEAR(mean[d], 0.5, 5.0 * sigma) << d;
      EXPECT_NEAR(square[d], 1.0 / 3.0, 6.0 * sigma) << d;
      EXPECT_NEAR(across[d], 0.0, 5.0 * product_sigma) << d;
      if (d == 0) continue;
      EXPECT_NEAR(next[d], 0.0, 5.0 * product_sigma) << d;
      EXPECT_NEAR(bit[d], 0.0, 5.0 / std::sqrt(double(kPixels))) << d;
    }
  }
}

// The same for the samples of one pixel: that dimensions are shuffled each by itself.
TEST(SampleRng, DimensionsOfOnePixelAreIndependent) {
  constexpr std::uint32_t kSamples = 4096;
  const double sigma = 1.0 / (12.0 * std::sqrt(double(kSamples)));
  int far = 0, all = 0;
  for (std::uint64_t pixel = 0; pixel < 20; ++pixel) {
    double product[8][8] = {};
    for (std::uint32_t s = 0; s < kSamples; ++s) {
      Rng rng = pixel_sample(pixel, s);
      double u[8];
      for (double& value : u) value = rng.stratified() - 0.5;
      for (int a = 0; a < 8; ++a)
        for (int b = 0; b < a; ++b) product[a][b] += u[a] * u[b] / kSamples;
    }
    for (int a = 0; a < 8; ++a) {
      for (int b = 0; b < a; ++b) {
        EXPECT_NEAR(product[a][b], 0.0, 6.0 * sigma) << a << " and " << b;
        far += std::fabs(product[a][b]) > 2.0 * sigma ? 1 : 0;
        ++all;
      }
    }
  }
  EXPECT_LT(far, all / 8);  // 4.6 % of a normal distribution
}

TEST(SampleRng, SmoothIntegrandsNeedFewerSamples) {
  const auto integrand = [](Rng& rng) {
    const Vec2f a = rng.stratified2(), b = rng.stratified2();
    return std::exp(-a.x - 2.0 * a.y) * (1.0 + b.x * b.y) + (rng.stratified() < 0.3f ? 1.0 : 0.0);
  };
  const double expected = (1 - std::exp(-1.0)) * (1 - std::exp(-2.0)) / 2 * 1.25 + 0.3;
  double stratified = 0.0, independent = 0.0, sum = 0.0;
  constexpr int kPixels = 400, kSamples = 64;
  for (std::uint64_t pixel = 0; pixel < kPixels; ++pixel) {
    double a = 0.0, b = 0.0;
    for (std::uint32_t s = 0; s < kSamples; ++s) {
      Rng sample = pixel_sample(pixel, s), alone(3, RngPurpose::test, pixel * kSamples + s);
      a += integrand(sample) / kSamples;
      b += integrand(alone) / kSamples;
    }
    stratified += (a - expected) * (a - expected) / kPixels;
    independent += (b - expected) * (b - expected) / kPixels;
    sum += a / kPixels;
  }
  EXPECT_NEAR(sum, expected, 5.0 * std::sqrt(stratified / kPixels));
  EXPECT_LT(stratified, independent / 10.0);
}

// What is not stratified differs between samples, and generators of no sample have no other numbers than before.
TEST(SampleRng, TheRestIsIndependent) {
  std::set<std::uint32_t> seen;
  for (std::uint32_t sample = 0; sample < 1000; ++sample) seen.insert(pixel_sample(0, sample).bits());
  EXPECT_GE(seen.size(), 999u);
  Rng one(3, RngPurpose::test, 5), same = one;
  const BitPair bits = one.stratified_bits2();
  EXPECT_EQ(bits.x, same.bits());
  EXPECT_EQ(bits.y, same.bits());
  EXPECT_EQ(one.stratified_bits(), same.bits());
  EXPECT_EQ(one.stratified(), same.uniform());
  const Vec2f a = one.stratified2(), b = same.uniform2();
  EXPECT_TRUE(a.x == b.x && a.y == b.y);
}

// Generators for other purposes by a sample's key: stratified over the same samples.
TEST(SampleRng, KeysNameTheSampleOfAPixel) {
  std::set<std::uint32_t> strata, others;
  for (std::uint32_t sample = 64; sample < 128; ++sample) {
    const auto of = [&](std::uint64_t pixel) {
      return Rng::of_sample_key(3, RngPurpose::test, 99, pixel_sample(pixel, sample).sample_key()).stratified_bits();
    };
    strata.insert(of(4) >> 26);
    others.insert(of(4));
    others.insert(of(5));
  }
  EXPECT_EQ(strata.size(), 64u);
  EXPECT_EQ(others.size(), 128u);
}

}  // namespace
}  // namespace octrad
