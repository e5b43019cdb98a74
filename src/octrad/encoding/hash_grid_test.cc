#include <gtest/gtest.h>

#include <cmath>

#include "octrad/base/each_target_test_helper.h"
#include "octrad/base/error.h"
#include "octrad/base/rng.h"
#include "octrad/encoding/hash_grid.h"
#include "octrad/encoding/shell_cells_test_helper.h"

namespace octrad {
namespace {

// Straight from the description, in double and apart from hash_grid_math.h.
std::vector<double> independent_lookup(const HashGrid& grid, Vec3f p) {
  const HashGridOptions& o = grid.options();
  std::vector<double> result;
  for (int l = 0; l < o.levels; ++l) {
    const double scale = static_cast<float>(o.base * std::pow(o.growth, l) - 1.0);
    const std::uint64_t r = static_cast<std::uint64_t>(std::ceil(scale)) + 1, table = std::uint64_t{1} << o.log2_table;
    const std::uint64_t first = static_cast<std::uint64_t>(grid.offsets()[l]),
                        size = static_cast<std::uint64_t>(grid.offsets()[l + 1]) - first;
    std::vector<double> sum(static_cast<std::size_t>(o.features), 0.0);
    for (int c = 0; c < 8; ++c) {
      double weight = 1.0;
      std::uint64_t v[3];
      for (int a = 0; a < 3; ++a) {
        const double position = std::min(std::max(double(p[a]), 0.0), 1.0) * scale + 0.5;
        v[a] = static_cast<std::uint64_t>(position) + ((c >> a) & 1);
        weight *= 1.0 - std::abs(position - double(v[a]));
      }
      std::uint64_t index = v[0] + r * (v[1] + r * v[2]);
      if (r * r * r > table) {
        const std::uint32_t hash =
            std::uint32_t(v[0]) ^ (std::uint32_t(v[1]) * 2654435761u) ^ (std::uint32_t(v[2]) * 805459861u);
        index = hash;
      }
      index %= size;
      for (int f = 0; f < o.features; ++f) sum[f] += weight * grid.table()[(first + index) * o.features + f];
    }
    result.insert(result.end(), sum.begin(), sum.end());
  }
  return result;
}

std::vector<Vec3f> positions(int n) {
  std::vector<Vec3f> p;
  Rng rng(1, RngPurpose::test, 21);
  for (int i = 0; i < n; ++i) {
    p.push_back({rng.uniform(), rng.uniform(), rng.uniform()});
    if (i % 5 == 0) p.back()[i / 5 % 3] = i % 2 ? 1.0f : 0.0f;
    if (i % 17 == 0) p.back() = Vec3f(i % 2 ? 1.0f : 0.0f);
    if (i % 13 == 0) p.back()[i % 3] = i % 2 ? 1.5f : -0.5f;
  }
  return p;
}

TEST(HashGrid, Offsets) {
  const HashGrid grid({.levels = 4, .features = 2, .log2_table = 17, .base = 32, .growth = 2.0});
  ASSERT_EQ(grid.offsets().size(), 5u);
  EXPECT_EQ(grid.offsets()[1], 32 * 32 * 32);              // scale 31, 32 vertices per axis
  EXPECT_EQ(grid.offsets()[2], 32 * 32 * 32 + (1 << 17));  // 64^3 does not fit
  EXPECT_EQ(grid.entry_count(), 32 * 32 * 32 + 3 * (1 << 17));
  EXPECT_EQ(grid.table().size(), static_cast<std::size_t>(grid.entry_count()) * 2);
  EXPECT_EQ(grid.feature_count(), 8);
  const HashGrid slow({.levels = 3, .features = 2, .log2_table = 19, .base = 16, .growth = 1.5});
  EXPECT_EQ(slow.offsets()[2] - slow.offsets()[1], 24 * 24 * 24);  // scale 23
  EXPECT_EQ(slow.offsets()[3] - slow.offsets()[2], 36 * 36 * 36);
}

TEST(HashGrid, RefusesOptionsOutOfRange) {
  EXPECT_THROW(HashGrid({.levels = 0}), InputError);
  EXPECT_THROW(HashGrid({.features = 3}), InputError);
  EXPECT_THROW(HashGrid({.log2_table = 40}), InputError);
  EXPECT_THROW(HashGrid({.base = 0}), InputError);
  EXPECT_THROW(HashGrid({.growth = NAN}), InputError);
  EXPECT_THROW(HashGrid({.levels = 16, .base = 4096}), InputError);
}

TEST(HashGrid, EverySimdTargetMatchesAnIndependentEvaluation) {
  testing::for_each_simd_target([] {
    for (const HashGridOptions& options :
         {HashGridOptions{6, 2, 13, 16, 2.0}, HashGridOptions{4, 4, 12, 8, 1.6}, HashGridOptions{4, 8, 14, 32, 2.0},
          HashGridOptions{1, 2, 15, 32, 2.0}, HashGridOptions{6, 2, 17, 32, 2.0}}) {
      HashGrid grid(options);
      testing::fill_random(grid.table(), 3);
      const int n = 403, stride = 410, count = grid.feature_count();
      const std::vector<Vec3f> p = positions(n);
      std::vector<float> out(static_cast<std::size_t>(count * stride), -7.0f), recorded(out);
      std::vector<Tap> taps;
      grid.lookup(p.data(), n, out.data(), stride);
      grid.lookup_record(p.data(), n, recorded.data(), stride, taps);
      ASSERT_EQ(taps.size(), static_cast<std::size_t>(n * options.levels * 8));
      for (int i = 0; i < n; ++i) {
        const std::vector<double> expected = independent_lookup(grid, p[static_cast<std::size_t>(i)]);
        for (int k = 0; k < count; ++k) {
          // A float position has 2^-24 of the box: 1e-7 x the finest resolution x the largest difference.
          const double tolerance = 4e-6 + 4e-7 * options.base * std::pow(options.growth, options.levels - 1);
          EXPECT_NEAR(out[static_cast<std::size_t>(k * stride + i)], expected[static_cast<std::size_t>(k)], tolerance)
              << i << ' ' << k;
          EXPECT_EQ(out[static_cast<std::size_t>(k * stride + i)], recorded[static_cast<std::size_t>(k * stride + i)]);
        }
        for (int l = 0; l < options.levels; ++l) {
          double weights = 0.0;
          std::vector<double> sum(static_cast<std::size_t>(options.features), 0.0);
          for (int c = 0; c < 8; ++c) {
            const Tap tap = taps[static_cast<std::size_t>((i * options.levels + l) * 8 + c)];
            ASSERT_GE(tap.entry, grid.offsets()[l]);
            ASSERT_LT(tap.entry, grid.offsets()[l + 1]);
            weights += tap.weight;
            for (int f = 0; f < options.features; ++f)
              sum[f] += double(tap.weight) * grid.table()[std::size_t{tap.entry} * options.features + f];
          }
          EXPECT_NEAR(weights, 1.0, 1e-6);
          for (int f = 0; f < options.features; ++f)
            EXPECT_NEAR(sum[f], recorded[static_cast<std::size_t>((l * options.features + f) * stride + i)], 2e-6);
        }
      }
      for (int k = 0; k < count; ++k) {
        for (int i = n; i < stride; ++i)
          EXPECT_EQ(out[static_cast<std::size_t>(k * stride + i)], -7.0f) << "wrote past n";
      }
    }
  });
}

TEST(HashGrid, WhatIsNotANumberIsHarmless) {
  testing::for_each_simd_target([] {
    HashGrid grid({.levels = 5, .features = 2, .log2_table = 12, .base = 8});
    testing::fill_random(grid.table(), 4);
    const float nan = std::nanf(""), inf = INFINITY;
    const std::vector<Vec3f> p{{nan, 0.5f, 0.5f}, {inf, -inf, nan}, {3e38f, -3e38f, 1e-42f}, {0.5f, 0.5f, 0.5f}};
    std::vector<float> out(40);
    std::vector<Tap> taps;
    grid.lookup_record(p.data(), 4, out.data(), 4, taps);
    for (const Tap& tap : taps) ASSERT_LT(tap.entry, grid.entry_count());
    for (float v : out) EXPECT_LE(std::abs(v), 1.0f);
    grid.lookup(nullptr, 0, nullptr, 0);
  });
}

TEST(HashGrid, ResultDoesNotDependOnThePlaceInTheBatch) {
  testing::for_each_simd_target([] {
    HashGrid grid({.levels = 6, .features = 2, .log2_table = 13, .base = 16});
    testing::fill_random(grid.table(), 5);
    const std::vector<Vec3f> p = positions(300);
    const int count = grid.feature_count();
    std::vector<float> all(static_cast<std::size_t>(count * 300)), part(all);
    grid.lookup(p.data(), 300, all.data(), 300);
    for (const auto& [first, n] : {std::pair{0, 1}, {3, 9}, {17, 100}, {299, 1}}) {
      grid.lookup(p.data() + first, n, part.data(), n);
      for (int k = 0; k < count; ++k) {
        for (int i = 0; i < n; ++i)
          ASSERT_EQ(part[static_cast<std::size_t>(k * n + i)], all[static_cast<std::size_t>(k * 300 + first + i)]);
      }
    }
  });
}

}  // namespace
}  // namespace octrad
