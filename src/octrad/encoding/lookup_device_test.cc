// Feature look-ups on the device against their definitions, and their gradients on the way back.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <set>
#include <vector>

#include "octrad/base/random_inputs.h"
#include "octrad/device/stream_test_helper.h"
#include "octrad/encoding/checks.h"
#include "octrad/encoding/prefiltered_grid.h"
#include "octrad/encoding/shell_cells_test_helper.h"

namespace octrad {
namespace {

using testing::ShellScene;

const Vec3f kOrigin{-1.0f, 2.0f, 0.5f}, kSize{4.0f, 3.0f, 2.5f};

// On the surfaces of the scene, some far outside, in the corner or nowhere.
std::vector<Vec3f> positions(const ShellScene& scene, std::size_t n) {
  std::vector<Vec3f> result(n);
  for (std::size_t i = 0; i < n; ++i) {
    Rng rng(5, RngPurpose::test, i);
    result[i] = kOrigin + scene.point(rng) * kSize;
    if (i % 97 == 5) result[i] = kOrigin + kSize * 1.5f;
    if (i % 97 == 7) result[i] = kOrigin;
    if (i % 97 == 9) result[i].y = std::numeric_limits<float>::quiet_NaN();
  }
  return result;
}

class DeviceLookup : public testing::StreamTest {
 protected:
  const ShellScene scene_{3};
};

TEST_P(DeviceLookup, OctreeFeaturesAreThoseOfTheDefinition) {
  const LookupQueries queries(*stream, positions(scene_, 1500), 3.0f, 6);
  for (const int features : {2, 4, 8}) {
    for (const int mode : {0, 1, 2}) {
      for (const bool halves : {false, true}) {
        OctaOctree tree({5, features, mode != 1, mode != 2, 1}, scene_.cells(5), kOrigin, kSize);
        const CheckResult r = check_octree_lookup(*stream, tree, queries, halves, 7);
        EXPECT_TRUE(testing::passed(r)) << features << " features, mode " << mode << ", halves " << halves;
        // Contracted multiplications may decide for another cell or vertex where none interpolates.
        EXPECT_TRUE(mode != 0 || r.above == 0.0) << features << " features, halves " << halves;
      }
    }
  }
}

TEST_P(DeviceLookup, OctreeGradientsReachTheEntriesThatWereRead) {
  const OctaOctreeOptions options{5, 4, true, true, 1};
  OctaOctree tree(options, scene_.cells(options.levels), kOrigin, kSize);
  testing::fill_random(tree.features(), 3);
  const LookupQueries b(*stream, positions(scene_, 700), 3.0f, 6);
  const UploadedFeatures table(*stream, tree.features(), false);
  const DeviceOctree device(*stream, tree);
  const std::size_t rows = static_cast<std::size_t>(tree.feature_count()),
                    entries = static_cast<std::size_t>(tree.entry_count());
  std::vector<float> upstream(rows * b.n);
  testing::fill_random(upstream, 4);
  const DeviceArray<float> d_features(*stream, std::span<const float>(upstream), "upstream");

  std::vector<double> expected(entries * 4, 0.0), by_disparity(b.n, 0.0);
  std::set<std::uint32_t> touched;
  std::vector<double> value(rows), slope(rows);
  for (std::size_t i = 0; i < b.n; ++i) {
    const Vec3f p = normalize_position(tree.view(), b.position(i));
    for (std::size_t l = 0; l < 5; ++l) {
      visit_level(tree.view(), tree.view().level[l], p, b.direction(i), b.d[i],
                  [&](std::uint32_t entry, float weight, float) {
                    if (weight == 0.0f) return;
                    touched.insert(entry);
                    for (std::size_t c = 0; c < 4; ++c)
                      expected[entry * 4 + c] += double(weight) * upstream[(l * 4 + c) * b.n + i];
                  });
    }
    lookup_query(tree.view(), Vec3d(b.position(i)), Vec3d(b.direction(i)), static_cast<double>(b.d[i]), value.data(),
                 slope.data());
    for (std::size_t f = 0; f < rows; ++f) by_disparity[i] += slope[f] * upstream[f * b.n + i];
  }

  DeviceArray<float> gradient(*stream, entries * 4, "gradient"), d_disparity(*stream, 5 * b.n, "d");
  DeviceArray<std::uint32_t> bits(*stream, entries / 32 + 1, "bits"), list(*stream, entries, "list"),
      count(*stream, 1, "count");
  gradient.fill(0);
  bits.fill(0);
  count.fill(0);
  device.scatter(*stream, table.view(), b.view, d_features.data(), b.n, d_disparity.data(), b.n,
                 AddNow{gradient.data(), {bits.data(), list.data(), count.data()}});
  const std::vector<float> sums = gradient.download(), parts = d_disparity.download();
  for (std::size_t k = 0; k < sums.size(); ++k)
    ASSERT_NEAR(sums[k], expected[k], 1e-4 * (1.0 + std::abs(expected[k]))) << k;
  const std::uint32_t listed = count.download()[0];
  std::vector<std::uint32_t> all = list.download();
  const std::set<std::uint32_t> distinct(all.begin(), all.begin() + listed);
  EXPECT_EQ(distinct.size(), listed) << "an entry is in the list twice";
  // On a device, rounding may decide otherwise about a weight of 0.
  std::size_t apart = 0;
  for (const std::uint32_t e : touched) apart += distinct.count(e) == 0;
  EXPECT_LE(apart, stream->on_device() ? touched.size() / 1000 : 0);
  int bad = 0;
  for (std::size_t i = 0; i < b.n; ++i) {
    double sum = 0.0;
    for (std::size_t l = 0; l < 5; ++l) sum += parts[l * b.n + i];
    bad += !(std::abs(sum - by_disparity[i]) < 2e-3 * (1.0 + std::abs(by_disparity[i])));
  }
  EXPECT_LE(bad, 7) << "derivative by the disparity (an edge of a triangle may lie on either side)";

  // The same contributions, written down for a sort.
  const std::size_t slots = b.n * 5 * kOctreeTaps;
  DeviceArray<std::uint32_t> kept_rows(*stream, slots, "rows");
  DeviceArray<float> kept_scales(*stream, slots, "scales");
  kept_rows.fill(0xff);
  device.scatter(*stream, table.view(), b.view, d_features.data(), b.n, nullptr, 0,
                 KeepForSort{kept_rows.data(), kept_scales.data()});
  std::vector<double> again(entries * 4, 0.0);
  const std::vector<std::uint32_t> keys = kept_rows.download();
  const std::vector<float> scales = kept_scales.download();
  for (std::size_t s = 0; s < slots; ++s) {
    if (keys[s] == kNoRow) continue;
    const std::size_t item = s / kOctreeTaps, l = item / b.n, i = item % b.n;
    for (std::size_t c = 0; c < 4; ++c)
      again[keys[s] * std::size_t{4} + c] += double(scales[s]) * upstream[(l * 4 + c) * b.n + i];
  }
  for (std::size_t k = 0; k < again.size(); ++k)
    ASSERT_NEAR(again[k], expected[k], 1e-4 * (1.0 + std::abs(expected[k]))) << k;
}

TEST_P(DeviceLookup, HashGridFeaturesAreThoseOfTheDefinition) {
  const LookupQueries queries(*stream, positions(scene_, 900), 0.0f, 6);
  for (const int features : {2, 4, 8}) {
    for (const bool halves : {false, true}) {
      HashGrid grid(HashGridOptions{4, features, 12, 8, 2.0});
      EXPECT_TRUE(testing::passed(check_hash_grid_lookup(*stream, grid, kOrigin, kSize, queries, halves, 9)))
          << features << " features, halves " << halves;
    }
  }
}

TEST_P(DeviceLookup, HashGridGradientsReachTheEntriesThatWereRead) {
  for (const int features : {2, 4, 8}) {
    const HashGrid grid(HashGridOptions{4, features, 12, 8, 2.0});
    const LookupQueries b(*stream, positions(scene_, 900), 0.0f, 6);
    const DeviceHashGrid device(grid, kOrigin, kSize);
    const std::size_t rows = static_cast<std::size_t>(grid.feature_count()), width = static_cast<std::size_t>(features);
    std::vector<float> upstream(rows * b.n);
    testing::fill_random(upstream, 4);
    std::vector<double> expected(grid.table().size(), 0.0);
    for (std::size_t i = 0; i < b.n; ++i) {
      for (std::size_t l = 0; l < 4; ++l) {
        std::uint32_t entry[8];
        float weight[8];
        hash_grid_taps(grid.view().level[l], (b.position(i) - kOrigin) / kSize, entry, weight);
        for (std::size_t c = 0; c < width; ++c) {
          for (int k = 0; k < 8; ++k)
            expected[entry[k] * width + c] += double(weight[k]) * upstream[(l * width + c) * b.n + i];
        }
      }
    }
    const DeviceArray<float> d_features(*stream, std::span<const float>(upstream), "upstream");
    DeviceArray<float> gradient(*stream, grid.table().size(), "gradient");
    gradient.fill(0);
    device.scatter(*stream, b.view, d_features.data(), b.n, AddNow{gradient.data(), {}});
    const std::vector<float> sums = gradient.download();
    for (std::size_t k = 0; k < sums.size(); ++k)
      ASSERT_NEAR(sums[k], expected[k], 2e-4 * (1.0 + std::abs(expected[k]))) << k;
  }
}

TEST_P(DeviceLookup, PrefilteredFeaturesAreThoseOfTheDefinition) {
  std::vector<Vec3f> p = positions(scene_, 900);
  for (Vec3f& v : p) v = (v - kOrigin) / kSize;
  for (const int features : {2, 4, 8}) {
    for (const bool halves : {false, true}) {
      HashGrid grid(HashGridOptions{6, features, 10, 4, 2.0});
      EXPECT_TRUE(testing::passed(check_prefiltered_lookup(*stream, grid, p, halves, 9)))
          << features << " features, halves " << halves;
    }
  }
}

// Against the taps that the CPU trains with.
TEST_P(DeviceLookup, PrefilteredGradientsReachTheEntriesThatWereRead) {
  std::vector<Vec3f> p = positions(scene_, 700);
  for (Vec3f& v : p) v = (v - kOrigin) / kSize;
  const FootprintQueries b(*stream, p, 5);
  for (const int features : {2, 4, 8}) {
    const HashGrid grid(HashGridOptions{6, features, 10, 4, 2.0});
    const DevicePrefilteredGrid device(grid);
    const std::size_t width = static_cast<std::size_t>(features), slots = b.n * kPrefilteredTaps;
    std::vector<float> upstream(width * b.n), values(width * b.n);
    testing::fill_random(upstream, 4);
    PrefilteredRecord record;
    prefiltered_lookup(grid.view(), p.data(), b.r.data(), static_cast<int>(b.n), values.data(), static_cast<int>(b.n),
                       &record);
    std::vector<double> expected(grid.table().size(), 0.0);
    for (std::size_t i = 0; i < b.n; ++i) {
      if (!(b.r[i] >= 0.0f)) continue;
      const std::size_t taps = record.blends[i].weight < 1.0f ? 16 : 8;
      for (std::size_t t = i * 16; t < i * 16 + taps; ++t) {
        for (std::size_t c = 0; c < width; ++c) {
          expected[record.taps[t].entry * width + c] +=
              static_cast<double>(record.taps[t].weight) * static_cast<double>(upstream[c * b.n + i]);
        }
      }
    }
    const DeviceArray<float> d_features(*stream, std::span<const float>(upstream), "upstream");
    DeviceArray<float> gradient(*stream, grid.table().size(), "gradient");
    gradient.fill(0);
    device.scatter(*stream, b.view, d_features.data(), b.n, AddNow{gradient.data(), {}});
    const std::vector<float> sums = gradient.download();
    DeviceArray<std::uint32_t> rows(*stream, slots, "rows");
    DeviceArray<float> scales(*stream, slots, "scales");
    rows.fill(0xff);
    device.scatter(*stream, b.view, d_features.data(), b.n, KeepForSort{rows.data(), scales.data()});
    std::vector<double> kept(grid.table().size(), 0.0);
    const std::vector<std::uint32_t> entries = rows.download();
    const std::vector<float> factors = scales.download();
    for (std::size_t s = 0; s < slots; ++s) {
      if (entries[s] == kNoRow) continue;
      for (std::size_t c = 0; c < width; ++c) {
        kept[entries[s] * width + c] +=
            static_cast<double>(factors[s]) * static_cast<double>(upstream[c * b.n + s / kPrefilteredTaps]);
      }
    }
    for (std::size_t k = 0; k < sums.size(); ++k) {
      ASSERT_NEAR(sums[k], expected[k], 2e-4 * (1.0 + std::abs(expected[k]))) << k;
      ASSERT_NEAR(kept[k], expected[k], 2e-4 * (1.0 + std::abs(expected[k]))) << k;
    }
  }
}

TEST_P(DeviceLookup, DirectionsAreMappedAsOnTheCpu) {
  EXPECT_TRUE(testing::passed(check_octahedral_map(*stream, 20'000, 1)));
  EXPECT_TRUE(testing::passed(check_spherical_harmonics(*stream, 20'000, 2)));
}

TEST_P(DeviceLookup, RowsBeyondTheQueueAreLeftAlone) {
  const OctaOctreeOptions options{3, 4, true, true};
  OctaOctree tree(options, scene_.cells(options.levels), kOrigin, kSize);
  testing::fill_random(tree.features(), 7);
  LookupQueries b(*stream, positions(scene_, 64), 3.0f, 6);
  const UploadedFeatures table(*stream, tree.features(), false);
  const DeviceOctree device(*stream, tree);
  const std::vector<std::uint32_t> length{100};
  const DeviceArray<std::uint32_t> count(*stream, std::span<const std::uint32_t>(length), "count");
  b.view.slice = {count.data(), 70};  // items 0 .. 29 hold something
  DeviceArray<float> out(*stream, 12 * b.n, "out");
  out.fill(0x11);
  const float untouched = out.download()[0];
  device.lookup(*stream, table.view(), b.view, FloatRows{out.data(), b.n}, 0);
  const std::vector<float> got = out.download();
  for (std::size_t f = 0; f < 12; ++f) {
    EXPECT_NE(got[f * b.n + 29], untouched);
    EXPECT_EQ(got[f * b.n + 30], untouched);
  }
}

INSTANTIATE_TEST_SUITE_P(All, DeviceLookup, ::testing::Bool(), testing::stream_name);

TEST(Halves, ConversionsAreThoseOfTheStandard) {
  for (std::uint32_t h = 0; h < 0x10000u; ++h) {
    const Half half{static_cast<std::uint16_t>(h)};
    const float f = to_float(half);
    const int exponent = static_cast<int>(h >> 10 & 31u);
    const double mantissa = h & 0x3ffu, sign = (h & 0x8000u) != 0 ? -1.0 : 1.0;
    if (exponent == 31) {
      EXPECT_TRUE(mantissa != 0 ? std::isnan(f) : std::isinf(f));
    } else {
      ASSERT_EQ(f, sign * (exponent == 0 ? std::ldexp(mantissa, -24) : std::ldexp(1024.0 + mantissa, exponent - 25)))
          << h;
    }
    if (!std::isnan(f)) {
      ASSERT_EQ(to_half(f).bits, h);
    }
    // Between two neighbours: to the nearer one, halfway to the even one.
    if (exponent < 30) {
      const float next = to_float(Half{static_cast<std::uint16_t>(h + 1)}), middle = 0.5f * (f + next);
      ASSERT_EQ(to_half(middle).bits, (h & 1u) != 0 ? h + 1 : h) << h;
      ASSERT_EQ(to_half(std::nextafter(middle, f)).bits, h);
      ASSERT_EQ(to_half(std::nextafter(middle, next)).bits, h + 1);
    }
  }
  EXPECT_EQ(to_half(65519.0f).bits, 0x7bffu);
  EXPECT_EQ(to_half(65520.0f).bits, 0x7c00u);
  EXPECT_EQ(unpack_halves(pack_halves(1.5f, -2.0f)).x, 1.5f);
  EXPECT_EQ(unpack_halves(pack_halves(1.5f, -2.0f)).y, -2.0f);
}

}  // namespace
}  // namespace octrad
