#include <algorithm>
#include <bit>
#include <cmath>

#include "octrad/base/random_inputs.h"
#include "octrad/encoding/checks.h"

namespace octrad {
namespace {

// look(rows, first) launches the look-ups, define(i, value) evaluates query i.
template <typename Look, typename Define>
CheckResult compare_features(Stream& stream, std::size_t n, std::size_t features, const Look& look,
                             const Define& define, double tolerance, double allowed = 0.0) {
  constexpr int kFirst = 2;
  DeviceArray<float> floats(stream, (features + kFirst) * n, "check");
  DeviceArray<std::uint32_t> halves(stream, (features + kFirst) / 2 * n, "check");
  floats.fill(0x11);
  halves.fill(0x11);
  look(FloatRows{floats.data(), n}, kFirst);
  look(HalfRows{halves.data(), n}, kFirst);
  const std::vector<float> found = floats.download();
  const std::vector<std::uint32_t> words = halves.download();
  std::vector<float> expected(features);
  CheckErrors errors, rounding;
  for (std::size_t i = 0; i < n; ++i) {
    define(i, expected.data());
    for (std::size_t f = 0; f < features; ++f) {
      const std::size_t row = f + kFirst;
      const Vec2f both = unpack_halves(words[row / 2 * n + i]);
      errors.compare(found[row * n + i], expected[f]);
      rounding.compare(row % 2 != 0 ? both.y : both.x, to_float(to_half(found[row * n + i])));
    }
  }
  CheckResult r = errors.exact_on_host(stream, "error of features in [-1, 1]", tolerance, allowed);
  r.require(rounding.exact_on_host(stream, "", 1e-3).passed, "rows of halves are not the rounded floats");
  const auto untouched = [](auto begin, auto end) {
    return std::all_of(begin, end, [](auto v) { return std::bit_cast<std::uint32_t>(v) == 0x11111111u; });
  };
  const auto before = static_cast<std::ptrdiff_t>(kFirst * n);
  r.require(untouched(found.begin(), found.begin() + before) && untouched(words.begin(), words.begin() + before / 2),
            "rows before the features are overwritten");
  return r;
}

}  // namespace

LookupQueries::LookupQueries(Stream& stream, std::span<const Vec3f> positions, float largest_disparity,
                             std::uint64_t seed)
    : n(positions.size()),
      x(3 * n),
      w(3 * n),
      d(n) {
  for (std::size_t i = 0; i < n; ++i) {
    Rng rng(seed, RngPurpose::test, i);
    const Vec3f direction = i % 13 == 0 ? Vec3f(0.0f, 0.0f, -1.0f) : uniform_direction(rng.uniform2());
    for (int a = 0; a < 3; ++a) {
      x[static_cast<std::size_t>(a) * n + i] = positions[i][a];
      w[static_cast<std::size_t>(a) * n + i] = direction[a];
    }
    d[i] = i % 4 == 0 ? 0.0f : largest_disparity * rng.uniform();
  }
  device_x = DeviceArray<float>(stream, std::span<const float>(x), "queries");
  device_w = DeviceArray<float>(stream, std::span<const float>(w), "queries");
  device_d = DeviceArray<float>(stream, std::span<const float>(d), "queries");
  view = {device_x.data(), n, device_w.data(), n, device_d.data(), {}, static_cast<std::uint32_t>(n)};
}

FootprintQueries::FootprintQueries(Stream& stream, std::span<const Vec3f> positions, std::uint64_t seed)
    : n(positions.size()),
      p(3 * n),
      r(n) {
  for (std::size_t i = 0; i < n; ++i) {
    Rng rng(seed, RngPurpose::test, i);
    for (int a = 0; a < 3; ++a) p[static_cast<std::size_t>(a) * n + i] = positions[i][a];
    r[i] = i % 7 == 0 ? -1.0f : i % 31 == 1 ? 0.0f : std::exp2(-9.0f * rng.uniform());
  }
  device_p = DeviceArray<float>(stream, std::span<const float>(p), "queries");
  device_r = DeviceArray<float>(stream, std::span<const float>(r), "queries");
  view = {device_p.data(), device_r.data(), n, {}, static_cast<std::uint32_t>(n)};
}

UploadedFeatures::UploadedFeatures(Stream& stream, std::span<float> values, bool as_halves) {
  if (!as_halves) {
    floats = DeviceArray<float>(stream, values, "features");
    return;
  }
  std::vector<Half> rounded(values.size());
  for (std::size_t i = 0; i < values.size(); ++i) {
    rounded[i] = to_half(values[i]);
    values[i] = to_float(rounded[i]);
  }
  halves = DeviceArray<Half>(stream, std::span<const Half>(rounded), "features");
}

CheckResult check_octree_lookup(Stream& stream, OctaOctree& tree, const LookupQueries& queries, bool halves,
                                std::uint64_t seed) {
  testing::fill_random(tree.features(), seed);
  const UploadedFeatures table(stream, tree.features(), halves);
  const DeviceOctree device(stream, tree);
  // A GPU's reciprocal moves positions by some 1e-7 of the domain. Where that puts a query into the next cell, or
  // across a fold of the map, the level reads other entries.
  return compare_features(
      stream, queries.n, static_cast<std::size_t>(tree.feature_count()),
      [&](auto rows, int first) { device.lookup(stream, table.view(), queries.view, rows, first); },
      [&](std::size_t i, float* value) {
        lookup_query<float>(tree.view(), queries.position(i), queries.direction(i), queries.d[i], value, nullptr);
      },
      1e-4, 1e-3);
}

CheckResult check_hash_grid_lookup(Stream& stream, HashGrid& grid, Vec3f origin, Vec3f size,
                                   const LookupQueries& queries, bool halves, std::uint64_t seed) {
  testing::fill_random(grid.table(), seed);
  const UploadedFeatures table(stream, grid.table(), halves);
  const DeviceHashGrid device(grid, origin, size);
  const HashGridView view = grid.view();
  const auto width = static_cast<std::size_t>(view.features);
  return compare_features(
      stream, queries.n, static_cast<std::size_t>(grid.feature_count()),
      [&](auto rows, int first) { device.lookup(stream, table.view(), queries.view, rows, first); },
      [&](std::size_t i, float* value) {
        for (int l = 0; l < view.levels; ++l) {
          std::uint32_t entry[8];
          float weight[8];
          hash_grid_taps(view.level[l], (queries.position(i) - origin) / size, entry, weight);
          for (std::size_t c = 0; c < width; ++c, ++value) {
            *value = 0.0f;
            for (int k = 0; k < 8; ++k) *value += weight[k] * view.table[entry[k] * width + c];
          }
        }
      },
      // Positions are rounded, on a GPU by its reciprocal too: a share of a cell, on three axes with slopes of up to 2.
      2.5e-6 * static_cast<double>(view.level[view.levels - 1].scale));
}

CheckResult check_prefiltered_lookup(Stream& stream, HashGrid& grid, std::span<const Vec3f> p, bool halves,
                                     std::uint64_t seed) {
  testing::fill_random(grid.table(), seed);
  const UploadedFeatures table(stream, grid.table(), halves);
  const FootprintQueries queries(stream, p, seed + 1);
  const DevicePrefilteredGrid device(grid);
  const HashGridView view = grid.view();
  const auto width = static_cast<std::size_t>(view.features);
  return compare_features(
      stream, queries.n, width,
      [&](auto rows, int first) { device.lookup(stream, table.view(), queries.view, rows, first); },
      [&](std::size_t i, float* value) {
        std::fill_n(value, width, 0.0f);
        if (!(queries.r[i] >= 0.0f)) return;
        // As the CPU adds them: level by level.
        visit_prefiltered(view, queries.position(i), queries.r[i],
                          [&](int, const std::uint32_t* entry, const float* weight, float of_level) {
                            for (std::size_t c = 0; c < width; ++c) {
                              float level = 0.0f;
                              for (int k = 0; k < 8; ++k) level += weight[k] * view.table[entry[k] * width + c];
                              value[c] += of_level * level;
                            }
                          });
      },
      5e-7 * static_cast<double>(view.level[view.levels - 1].scale));
}

}  // namespace octrad
