#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "app/selftest/entries.h"
#include "app/selftest/kernels.h"
#include "app/selftest/rays.h"
#include "app/selftest/selftest.h"
#include "octrad/base/rng.h"
#include "octrad/base/sobol_math.h"
#include "octrad/device/array.h"
#include "octrad/device/sort.h"
#include "octrad/encoding/octahedral_math.h"
#include "octrad/encoding/spherical_harmonics_math.h"

namespace octrad::selftest {

void Errors::add(double error) {
  errors_.push_back(std::isnan(error) ? std::numeric_limits<double>::infinity() : error);
}

CheckResult Errors::result(std::string what, double tolerance, double allowed_share) {
  CheckResult r;
  r.error = std::move(what);
  r.items = errors_.size();
  r.tolerance = tolerance;
  r.allowed = allowed_share;
  if (errors_.empty()) return r;  // nothing was looked at: not passed
  std::sort(errors_.begin(), errors_.end());
  const auto at = [&](double share) {
    return errors_[std::min(errors_.size() - 1, static_cast<std::size_t>(share * static_cast<double>(errors_.size())))];
  };
  r.p50 = at(0.5);
  r.p99 = at(0.99);
  r.p999 = at(0.999);
  r.max = errors_.back();
  r.above = static_cast<double>(errors_.end() - std::upper_bound(errors_.begin(), errors_.end(), tolerance)) /
            static_cast<double>(errors_.size());
  r.passed = r.above <= allowed_share;
  return r;
}

namespace {

using Words = std::vector<std::uint32_t>;

// Against a reference of size 1 at least: absolute for small values.
double relative(double value, double reference) {
  return std::fabs(value - reference) / std::max(1.0, std::fabs(reference));
}

CheckResult equal_words(const Words& got, const Words& expected, const char* what) {
  Errors errors;
  for (std::size_t i = 0; i < got.size(); ++i) errors.add(got[i] == expected[i] ? 0.0 : 1.0);
  return errors.result(what, 0.0);
}

Words random_words(std::size_t n, std::uint64_t seed) {
  Words words(n);
  for (std::size_t i = 0; i < n; ++i) words[i] = Rng(seed, RngPurpose::test, i).bits();
  return words;
}

std::vector<Vec3f> random_directions(std::size_t n, std::uint64_t seed) {
  std::vector<Vec3f> directions(n);
  for (std::size_t i = 0; i < n; ++i) {
    Rng rng(seed, RngPurpose::test, i);
    directions[i] = uniform_direction(rng.uniform2());
  }
  return directions;
}

std::vector<float> random_floats(std::size_t n, std::uint64_t seed, float low, float high) {
  std::vector<float> values(n);
  for (std::size_t i = 0; i < n; ++i) values[i] = low + (high - low) * Rng(seed, RngPurpose::test, i).uniform();
  return values;
}

CheckResult check_rng(const Context& c) {
  const std::size_t n = c.items(1 << 20, 1 << 16);
  const DeviceArray<std::uint32_t> out(c.stream, n, "selftest");
  run_rng(c.stream, n, c.seed, out.data());
  Words expected(n);
  for (std::size_t i = 0; i < n; ++i) {
    Rng rng(c.seed, RngPurpose::test, i);
    rng.bits();
    expected[i] = rng.bits();
  }
  return equal_words(out.download(), expected, "other bits");
}

CheckResult check_sobol(const Context& c) {
  const std::size_t n = 1 << 16;
  const DeviceArray<std::uint32_t> out(c.stream, 3 * n, "selftest");
  run_sobol(c.stream, n, out.data());
  Words expected(3 * n);
  for (std::size_t i = 0; i < n; ++i) sobol3(static_cast<std::uint32_t>(i), expected.data() + 3 * i);
  return equal_words(out.download(), expected, "other bits");
}

CheckResult check_atomics(const Context& c) {
  const std::size_t n = c.items(1 << 22, 1 << 17);  // below 2^24, so that the float counts exactly
  const Words values = random_words(n, c.seed);
  const DeviceArray<std::uint32_t> in(c.stream, std::span<const std::uint32_t>(values), "selftest");
  DeviceArray<std::uint32_t> counts(c.stream, 8, "selftest"), flags(c.stream, 1, "selftest");
  DeviceArray<float> sum(c.stream, 1, "selftest");
  counts.fill(0);
  flags.fill(0);
  sum.fill(0);
  run_atomics(c.stream, n, in.data(), counts.data(), sum.data(), flags.data());
  Words expected(8, 0);
  std::uint32_t bits = 0;
  for (const std::uint32_t v : values) {
    ++expected[v & 7u];
    bits |= 1u << (v & 7u);
  }
  Words got = counts.download();
  got.push_back(flags.download()[0]);
  got.push_back(static_cast<std::uint32_t>(sum.download()[0]));
  expected.push_back(bits);
  expected.push_back(static_cast<std::uint32_t>(n));
  return equal_words(got, expected, "wrong counts");
}

CheckResult check_sort(const Context& c) {
  const std::size_t n = c.items(1 << 21, 1 << 16);
  constexpr int kBits = 20;
  const Words keys = random_words(n, c.seed);
  Words places(n);
  std::iota(places.begin(), places.end(), 0u);
  const SortWorkspace workspace(c.stream, n, "selftest");
  const DeviceArray<std::uint32_t> keys_in(c.stream, std::span<const std::uint32_t>(keys), "selftest");
  const DeviceArray<std::uint32_t> values_in(c.stream, std::span<const std::uint32_t>(places), "selftest");
  const DeviceArray<std::uint32_t> keys_out(c.stream, n, "selftest"), values_out(c.stream, n, "selftest");
  sort_pairs(c.stream, workspace, n, keys_in.data(), keys_out.data(), values_in.data(), values_out.data(), kBits);
  const std::uint32_t mask = (1u << kBits) - 1u;
  std::stable_sort(places.begin(), places.end(),
                   [&](std::uint32_t a, std::uint32_t b) { return (keys[a] & mask) < (keys[b] & mask); });
  return equal_words(values_out.download(), places, "wrong places");
}

CheckResult check_scan(const Context& c) {
  const std::size_t n = c.items(1 << 21, 1 << 16);
  const Words values = random_words(n, c.seed);
  const SortWorkspace workspace(c.stream, n, "selftest");
  const DeviceArray<std::uint32_t> data(c.stream, std::span<const std::uint32_t>(values), "selftest");
  exclusive_sum(c.stream, workspace, n, data.data(), data.data());
  Words expected(n);
  std::exclusive_scan(values.begin(), values.end(), expected.begin(), 0u);
  return equal_words(data.download(), expected, "wrong sums");
}

CheckResult check_sum(const Context& c) {
  const std::size_t n = c.items(1 << 22, 1 << 17);
  const std::vector<float> values = random_floats(n, c.seed, 0.0f, 1.0f);
  const SortWorkspace workspace(c.stream, n, "selftest");
  const DeviceArray<float> in(c.stream, std::span<const float>(values), "selftest"), out(c.stream, 1, "selftest");
  sum(c.stream, workspace, n, in.data(), out.data());
  const double expected = std::accumulate(values.begin(), values.end(), 0.0);
  Errors errors;
  errors.add(std::fabs(static_cast<double>(out.download()[0]) - expected) / expected);
  return errors.result("relative error of the sum", 1e-5);
}

CheckResult check_octahedral(const Context& c) {
  const std::size_t n = c.items(1 << 20, 1 << 16);
  const std::vector<Vec3f> directions = random_directions(n, c.seed);
  const DeviceArray<Vec3f> in(c.stream, std::span<const Vec3f>(directions), "selftest");
  const DeviceArray<Vec2f> out(c.stream, n, "selftest");
  run_octahedral(c.stream, n, in.data(), out.data());
  const std::vector<Vec2f> got = out.download();
  Errors errors;
  for (std::size_t i = 0; i < n; ++i) {
    const Vec2<double> u = octa_project(Vec3d(directions[i])).u;
    errors.add(std::max(std::fabs(got[i].x - u.x), std::fabs(got[i].y - u.y)));
  }
  return errors.result("distance on the square", 5e-7);
}

CheckResult check_spherical_harmonics(const Context& c) {
  const std::size_t n = c.items(1 << 18, 1 << 14);
  const std::vector<Vec3f> directions = random_directions(n, c.seed);
  const DeviceArray<Vec3f> in(c.stream, std::span<const Vec3f>(directions), "selftest");
  const DeviceArray<float> out(c.stream, 16 * n, "selftest");
  run_spherical_harmonics(c.stream, n, in.data(), out.data());
  const std::vector<float> got = out.download();
  Errors errors;
  for (std::size_t i = 0; i < n; ++i) {
    double expected[16];
    spherical_harmonics(Vec3d(directions[i]), expected);
    for (std::size_t k = 0; k < 16; ++k) errors.add(std::fabs(got[16 * i + k] - expected[k]));
  }
  return errors.result("absolute error", 2e-6);
}

CheckResult check_hash_grid(const Context& c) {
  const std::size_t n = c.items(1 << 18, 1 << 14);
  const auto levels = hash_grid_levels();
  const std::size_t entries = levels.back().first_entry + levels.back().entries;
  const std::vector<float> table = random_floats(entries * 2, c.seed, -1.0f, 1.0f);
  const std::vector<float> coordinates = random_floats(3 * n, c.seed + 1, 0.0f, 1.0f);
  std::vector<Vec3f> positions(n);
  for (std::size_t i = 0; i < n; ++i)
    positions[i] = {coordinates[3 * i], coordinates[3 * i + 1], coordinates[3 * i + 2]};
  const DeviceArray<float> device_table(c.stream, std::span<const float>(table), "selftest");
  const DeviceArray<Vec3f> in(c.stream, std::span<const Vec3f>(positions), "selftest");
  HashGridView grid;
  grid.table = device_table.data();
  grid.levels = static_cast<int>(levels.size());
  grid.features = 2;
  std::copy(levels.begin(), levels.end(), grid.level);
  const DeviceArray<float> out(c.stream, n * levels.size(), "selftest");
  run_hash_grid(c.stream, n, grid, in.data(), out.data());
  const std::vector<float> got = out.download();
  Errors errors;
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t l = 0; l < levels.size(); ++l) {
      std::uint32_t entry[8];
      double weight[8], expected = 0.0;
      hash_grid_taps(levels[l], Vec3d(positions[i]), entry, weight);
      for (int k = 0; k < 8; ++k) expected += weight[k] * static_cast<double>(table[2 * entry[k]]);
      errors.add(relative(got[i * levels.size() + l], expected));
    }
  }
  return errors.result("error of the features",
                       1e-3);  // positions are rounded to 2^-24 of the finest level's 2^10 cells
}

CheckResult check_adam(const Context& c) {
  const std::size_t n = c.items(1 << 20, 1 << 15);
  const AdamConstants k = adam_constants(0.9, 0.99, 1e-15);
  const AdamCorrection correction = adam_correction(0.9, 0.99, 3.0);
  const float rate = 0.01f * correction.first;
  const std::vector<float> gradients = random_floats(n, c.seed, -1.0f, 1.0f),
                           start = random_floats(n, c.seed + 1, -1.0f, 1.0f),
                           m0 = random_floats(n, c.seed + 2, -0.5f, 0.5f),
                           v0 = random_floats(n, c.seed + 3, 0.0f, 0.5f);
  const DeviceArray<float> g(c.stream, std::span<const float>(gradients), "selftest"),
      p(c.stream, std::span<const float>(start), "selftest"), m(c.stream, std::span<const float>(m0), "selftest"),
      v(c.stream, std::span<const float>(v0), "selftest");
  run_adam(c.stream, n, k, rate, correction.second, g.data(), p.data(), m.data(), v.data());
  const std::vector<float> got = p.download();
  Errors errors;
  for (std::size_t i = 0; i < n; ++i) {
    float mean = m0[i], square = v0[i];
    errors.add(relative(got[i], adam_update(start[i], gradients[i], mean, square, k, rate, correction.second)));
  }
  return errors.result("error of the parameters", 1e-6);
}

constexpr Check kChecks[] = {
    {"random numbers", check_rng},
    {"Sobol points", check_sobol},
    {"atomics", check_atomics},
    {"sort", check_sort},
    {"scan", check_scan},
    {"sum", check_sum},
    {"octahedral map", check_octahedral},
    {"spherical harmonics", check_spherical_harmonics},
    {"hash grid", check_hash_grid},
    {"Adam", check_adam},
    {"closest hit, Embree", check_closest_embree},
    {"closest hit, same tree on the CPU", check_closest_cpu},
    {"closest hit, a thread a ray", check_closest_alone},
    {"occlusion, Embree", check_occluded},
    {"occlusion, a thread a ray", check_occluded_alone},
    {"feature lookup, floats", check_lookup_floats},
    {"feature lookup, halves", check_lookup_halves},
    {"decoder", check_decoder},
    {"optimiser, network", check_network_optimiser},
    {"optimiser, table of touched entries", check_touched_optimiser},
    {"optimiser, dense table", check_dense_optimiser},
    {"materials and lights", check_shading, true},
    {"left-hand-side points", check_left_hand_sides},
    {"right-hand sides", check_right_hand_sides},
    {"first hits", check_first_hits},
    {"paths", check_paths},
    {"paths, a thread each", check_long_paths},
    {"film", check_film},
};

}  // namespace

std::span<const Check> checks() { return kChecks; }

}  // namespace octrad::selftest
