// Moments of Adam in half the bytes: what one word holds, and where long runs of rounded moments end.
#include "octrad/network/packed_moments_math.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "octrad/network/adam_math.h"

namespace octrad {
namespace {

constexpr float kLargest = std::numeric_limits<float>::max();

TEST(PackedMoments, AverageOverAllRoundingsIsTheMoment) {
  for (const float x : {1.0f, 1.234567f, -0.7654321f, 3e-20f, -1.1e-38f, 2e-41f, 0.0f}) {
    double m_sum = 0.0, v_sum = 0.0;
    for (std::uint32_t random = 0; random < 0x10000u; ++random) {
      float m, v;
      unpack_moments(pack_moments(x, std::fabs(x), random), m, v);
      m_sum += static_cast<double>(m);
      v_sum += static_cast<double>(v);
      EXPECT_LE(std::fabs(m - x), std::max(std::fabs(x) * 0x1p-7f, 0x1p-133f));
      EXPECT_EQ(v, std::fabs(m)) << "both are rounded alike";
    }
    EXPECT_EQ(m_sum / 0x10000, static_cast<double>(x));
    EXPECT_EQ(v_sum / 0x10000, std::fabs(static_cast<double>(x)));
  }
}

TEST(PackedMoments, WhatIsRoundedStaysAndWhatIsFiniteIsFinite) {
  for (const float x : {0.0f, 1.5f, -0x1.02p-100f, 0x1p-133f, 0x1.fep127f}) {
    for (const std::uint32_t random : {0u, 0x8000u, 0xffffu}) {
      float m, v;
      unpack_moments(pack_moments(x, std::fabs(x), random), m, v);
      EXPECT_EQ(m, x);
      EXPECT_EQ(v, std::fabs(x));
    }
  }
  float m, v;
  unpack_moments(pack_moments(-kLargest, kLargest, 0xffffu), m, v);
  EXPECT_EQ(m, -0x1.fep127f);
  EXPECT_EQ(v, 0x1.fep127f);
}

TEST(PackedMoments, RoundingsOfComponentsAndStepsDiffer) {
  int equal = 0;
  for (std::uint64_t number = 0; number < 4000; ++number) {
    const std::uint32_t random = rounding_of(four_roundings(7, number), number);
    EXPECT_LT(random, 0x10000u);
    equal += random == rounding_of(four_roundings(7, number + 1), number + 1) ? 1 : 0;
    equal += random == rounding_of(four_roundings(8, number), number) ? 1 : 0;
  }
  EXPECT_LT(equal, 5);
}

// An entry's mean of squares after a long run of noise, and after another one of smaller noise, in units of what floats
// hold there. `nearest`: what rounding to nearest would make of it.
void run(bool nearest, double& first, double& second) {
  const AdamConstants constants = adam_constants(0.9, 0.999, 1e-8);
  double packed[2] = {}, exact[2] = {};
  for (std::uint64_t entry = 0; entry < 200; ++entry) {
    Rng rng(5, RngPurpose::test, entry);
    float m = 0.0f, v = 0.0f, exact_m = 0.0f, exact_v = 0.0f;
    for (std::uint64_t step = 0; step < 12000; ++step) {
      const float gradient = (step < 6000 ? 1e-4f : 3e-5f) * (2.0f * rng.uniform() - 1.0f);
      adam_update(0.0f, gradient, m, v, constants, 1e-3f, 1.0f);
      adam_update(0.0f, gradient, exact_m, exact_v, constants, 1e-3f, 1.0f);
      const std::uint32_t random = rounding_of(four_roundings(mix64(step), entry), entry);
      unpack_moments(pack_moments(m, v, nearest ? 0x8000u : random), m, v);
      if (step % 6000 < 5999) continue;
      packed[step / 6000] += static_cast<double>(v);
      exact[step / 6000] += static_cast<double>(exact_v);
    }
  }
  first = packed[0] / exact[0];
  second = packed[1] / exact[1];
}

TEST(PackedMoments, LongMeansOfSquaresAreKept) {
  double first = 0.0, second = 0.0;
  run(false, first, second);
  EXPECT_NEAR(first, 1.0, 0.02);  // five standard errors of the mean of 200
  EXPECT_NEAR(second, 1.0, 0.02);
  run(true, first, second);
  EXPECT_TRUE(std::fabs(first - 1.0) > 0.1 || std::fabs(second - 1.0) > 0.1)
      << first << " " << second << ": it would do";
}

}  // namespace
}  // namespace octrad
