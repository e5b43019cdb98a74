#include <gtest/gtest.h>

#include <cmath>

#include "octrad/base/rng.h"
#include "octrad/encoding/hash_grid.h"
#include "octrad/encoding/prefiltered_grid.h"

namespace octrad {
namespace {

constexpr HashGridOptions kOptions = {.levels = 5, .features = 8, .log2_table = 12, .base = 4, .growth = 2.0};

HashGrid random_grid(const HashGridOptions& options = kOptions) {
  HashGrid grid(options);
  Rng rng(1, RngPurpose::test, 31);
  for (float& v : grid.table()) v = rng.uniform() - 0.5f;
  return grid;
}

struct FootprintQueries {
  std::vector<Vec3f> p;
  std::vector<float> r;
};

// Footprints from below the finest level's to above the coarsest's, some of them exactly a level's.
FootprintQueries random_queries(int n) {
  FootprintQueries q;
  Rng rng(2, RngPurpose::test, 32);
  for (int i = 0; i < n; ++i) {
    q.p.push_back({rng.uniform(), rng.uniform(), rng.uniform()});
    q.r.push_back(i % 7 == 0 ? std::ldexp(0.5f, -(i / 7 % 5)) : std::exp2(-7.0f * rng.uniform()));
  }
  q.r[1] = 0.0f;
  q.r[2] = 1e9f;
  return q;
}

// All levels in full by HashGrid, and the blend in double, straight from its description.
std::vector<double> brute_force(const HashGrid& grid, Vec3f p, double r) {
  const auto levels = static_cast<std::size_t>(grid.options().levels),
             width = static_cast<std::size_t>(grid.options().features);
  std::vector<float> all(levels * width);
  grid.lookup(&p, 1, all.data(), 1);
  std::vector<double> footprint, result(width);
  for (std::size_t l = 0; l < levels; ++l)
    footprint.push_back(2.0 / (grid.options().base * std::pow(grid.options().growth, static_cast<double>(l))));
  for (std::size_t l = 0; l < levels; ++l) {
    double weight = 0.0;  // a hat over the level's footprint, which stays 1 beyond the first and the last
    if (r >= footprint[l]) {
      weight = l == 0 ? 1.0 : std::max(0.0, (footprint[l - 1] - r) / (footprint[l - 1] - footprint[l]));
    } else {
      weight = l + 1 == levels ? 1.0 : std::max(0.0, (r - footprint[l + 1]) / (footprint[l] - footprint[l + 1]));
    }
    for (std::size_t f = 0; f < width; ++f) result[f] += weight * static_cast<double>(all[l * width + f]);
  }
  return result;
}

std::vector<float> lookup(const HashGrid& grid, const FootprintQueries& q, PrefilteredRecord* record = nullptr) {
  const auto n = static_cast<int>(q.p.size());
  std::vector<float> out(static_cast<std::size_t>(grid.options().features) * q.p.size());
  prefiltered_lookup(grid.view(), q.p.data(), q.r.data(), n, out.data(), n, record);
  return out;
}

TEST(PrefilteredGrid, IsTheBlendOfAllLevels) {
  for (const double growth : {2.0, 1.5}) {
    HashGridOptions options = kOptions;
    options.growth = growth;
    const HashGrid grid = random_grid(options);
    const FootprintQueries q = random_queries(200);
    const std::vector<float> out = lookup(grid, q);
    for (std::size_t i = 0; i < q.p.size(); ++i) {
      const std::vector<double> expected = brute_force(grid, q.p[i], static_cast<double>(q.r[i]));
      for (std::size_t f = 0; f < expected.size(); ++f)
        EXPECT_NEAR(out[f * q.p.size() + i], expected[f], 2e-6) << i << " " << q.r[i];
    }
  }
}

TEST(PrefilteredGrid, AQueryDoesNotDependOnThoseBesideIt) {
  const HashGrid grid = random_grid();
  const FootprintQueries q = random_queries(133);
  const std::vector<float> together = lookup(grid, q);
  for (const std::size_t i : {std::size_t{0}, std::size_t{50}, std::size_t{132}}) {
    const std::vector<float> alone = lookup(grid, {{q.p[i]}, {q.r[i]}});
    for (std::size_t f = 0; f < alone.size(); ++f) EXPECT_EQ(alone[f], together[f * q.p.size() + i]);
  }
}

// Taps are the derivatives by the table: the sum of taps times entries is the feature, and moving an entry moves it by
// its taps.
TEST(PrefilteredGrid, TapsAreTheGradientByTheFeatures) {
  HashGrid grid = random_grid();
  const FootprintQueries q = random_queries(60);
  PrefilteredRecord record;
  const std::vector<float> out = lookup(grid, q, &record);
  EXPECT_EQ(out, lookup(grid, q));
  const auto taps_of = [&](std::size_t i) {
    return std::span(record.taps).subspan(i * 16, record.blends[i].weight < 1.0f ? 16 : 8);
  };
  const std::size_t width = 8;
  for (std::size_t i = 0; i < q.p.size(); ++i) {
    for (std::size_t f = 0; f < width; ++f) {
      double sum = 0.0;
      for (const Tap& tap : taps_of(i)) sum += static_cast<double>(tap.weight) * grid.table()[tap.entry * width + f];
      EXPECT_NEAR(sum, out[f * q.p.size() + i], 2e-6);
    }
  }
  for (std::size_t i = 0; i < q.p.size(); i += 7) {
    const std::uint32_t entry = taps_of(i)[3].entry;
    float& value = grid.table()[entry * width + 2];
    const float before = value;
    value += 0.5f;
    const std::vector<float> moved = lookup(grid, q);
    value = before;
    for (std::size_t j = 0; j < q.p.size(); ++j) {
      double expected = 0.0;
      for (const Tap& tap : taps_of(j)) expected += tap.entry == entry ? 0.5 * static_cast<double>(tap.weight) : 0.0;
      EXPECT_NEAR(moved[2 * q.p.size() + j] - out[2 * q.p.size() + j], expected, 2e-6);
    }
  }
}

// Between two footprints a feature is linear in r with the slope (coarse - fine) / (difference of footprints).
TEST(PrefilteredGrid, SlopeByTheFootprint) {
  const HashGrid grid = random_grid();
  const Vec3f p{0.3f, 0.6f, 0.2f};
  std::vector<float> all(40);
  grid.lookup(&p, 1, all.data(), 1);
  for (std::size_t l = 0; l + 1 < 5; ++l) {
    const double coarse = std::ldexp(0.5, -static_cast<int>(l)), fine = coarse / 2;
    for (std::size_t f = 0; f < 8; ++f) {
      const auto at = [&](double r) {
        const LevelBlend<double> b = blend_levels(grid.view(), r);
        EXPECT_EQ(b.level, static_cast<int>(l));
        return b.weight * static_cast<double>(all[l * 8 + f]) +
               (1 - b.weight) * static_cast<double>(all[(l + 1) * 8 + f]);
      };
      const double slope =
          (static_cast<double>(all[l * 8 + f]) - static_cast<double>(all[(l + 1) * 8 + f])) / (coarse - fine);
      const double r = 0.7 * fine + 0.3 * coarse, h = 1e-4 * fine;
      EXPECT_NEAR((at(r + h) - at(r - h)) / (2 * h), slope, 1e-9 * std::abs(slope) + 1e-9);
    }
  }
  // Constant beyond the ends.
  EXPECT_EQ(blend_levels(grid.view(), 0.9).weight, 1.0);
  EXPECT_EQ(blend_levels(grid.view(), 0.9).level, 0);
  EXPECT_EQ(blend_levels(grid.view(), 0.01).level, 4);
  EXPECT_EQ(blend_levels(grid.view(), 0.01).weight, 1.0);
}

// What the levels are for: with vertices that hold averages of a function over boxes of the level's footprint, a
// look-up is about the average over a box of its own footprint. Against brute-force averages of 8^3 samples.
TEST(PrefilteredGrid, FilledWithAveragesItGivesAverages) {
  const auto average = [](Vec3f center, double side) {
    double sum = 0.0;
    constexpr int kSide = 8;
    for (int i = 0; i < kSide * kSide * kSide; ++i) {
      const auto offset = [&](int k) { return ((k % kSide + 0.5) / kSide - 0.5) * side; };
      const double x = static_cast<double>(center.x) + offset(i), y = static_cast<double>(center.y) + offset(i / kSide),
                   z = static_cast<double>(center.z) + offset(i / (kSide * kSide));
      sum += std::sin(5.0 * x) * std::cos(3.0 * y) + z * z;
    }
    return sum / (kSide * kSide * kSide);
  };
  HashGridOptions options = kOptions;
  options.levels = 3;  // all dense
  HashGrid grid(options);
  const HashGridView view = grid.view();
  for (int l = 0; l < view.levels; ++l) {
    const HashGridLevelView& level = view.level[l];
    ASSERT_TRUE(level.dense);
    const int r = static_cast<int>(level.resolution);
    for (int v = 0; v < r * r * r; ++v) {
      const auto at = [&](int k) { return (static_cast<float>(k % r) - 0.5f) / level.scale; };
      grid.table()[(level.first_entry + static_cast<std::size_t>(v)) * 8] = static_cast<float>(
          average({at(v), at(v / r), at(v / (r * r))}, static_cast<double>(level_footprint<float>(level))));
    }
  }
  Rng rng(3, RngPurpose::test, 33);
  FootprintQueries q;
  for (int i = 0; i < 200; ++i) {
    const auto inside = [&] { return 0.2f + 0.6f * rng.uniform(); };  // away from the wrap at the far side
    q.p.push_back({inside(), inside(), inside()});
    q.r.push_back(0.13f + 0.36f * rng.uniform());
  }
  const std::vector<float> out = lookup(grid, q);
  double error = 0.0, contrast = 0.0;
  for (std::size_t i = 0; i < q.p.size(); ++i) {
    const double expected = average(q.p[i], static_cast<double>(q.r[i]));
    error += std::abs(static_cast<double>(out[i]) - expected);
    contrast += std::abs(expected);
  }
  EXPECT_LT(error, 0.1 * contrast);
}

}  // namespace
}  // namespace octrad
