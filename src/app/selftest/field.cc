#include <algorithm>
#include <cmath>

#include "app/selftest/entries.h"
#include "app/selftest/rays.h"
#include "octrad/base/rng.h"
#include "octrad/device/array.h"
#include "octrad/encoding/lookup_device.h"
#include "octrad/encoding/octaoctree.h"
#include "octrad/geometry/surface_sampling.h"
#include "octrad/geometry/voxelize.h"

namespace octrad::selftest {
namespace {

constexpr int kFeatures = 4;

OctaOctree make_octree(const Scene& scene, int levels) {
  const Domain domain = scene_domain(scene.bounds, true);
  return OctaOctree({levels, kFeatures}, occupied_cells(scene, domain, levels), domain.origin, domain.size);
}

// Queries on the scene's surfaces in random directions, with and without a disparity. `sorted`: neighbours in space are
// neighbours in memory, by cells of a grid of 32^3 in Morton order, as a sort of 15-bit keys would have them.
struct Queries {
  std::vector<float> x, w, d;  // [3][n], [3][n], [n]
  DeviceArray<float> device_x, device_w, device_d;
  DeviceQueries view;

  Queries(const Context& c, std::size_t n, bool sorted = false) : x(3 * n), w(3 * n), d(n) {
    const SurfaceSampler sampler(c.scene);
    const Domain domain = scene_domain(c.scene.bounds, true);
    std::vector<Vec3f> positions(n);
    std::vector<std::pair<std::uint64_t, std::uint32_t>> order(n);
    const float size = length(c.scene.bounds.upper - c.scene.bounds.lower);
    for (std::size_t i = 0; i < n; ++i) {
      Rng rng(c.seed, RngPurpose::test, i);
      const float pick = rng.uniform();
      positions[i] = sampler.sample_position(pick, rng.uniform2());
      const Vec3f cell = (positions[i] - domain.origin) / domain.size * 32.0f;
      order[i] = {
          sorted ? morton_key({static_cast<int>(cell.x), static_cast<int>(cell.y), static_cast<int>(cell.z)}) : 0,
          static_cast<std::uint32_t>(i)};
    }
    std::sort(order.begin(), order.end());
    for (std::size_t i = 0; i < n; ++i) {
      Rng rng(c.seed + 2, RngPurpose::test, i);
      const Vec3f p = positions[order[i].second], direction = uniform_direction(rng.uniform2());
      for (int a = 0; a < 3; ++a) {
        x[static_cast<std::size_t>(a) * n + i] = p[a];
        w[static_cast<std::size_t>(a) * n + i] = direction[a];
      }
      const float u = rng.uniform();
      d[i] = u < 0.25f ? 0.0f : 4.0f * u / size;
    }
    device_x = DeviceArray<float>(c.stream, std::span<const float>(x), "selftest");
    device_w = DeviceArray<float>(c.stream, std::span<const float>(w), "selftest");
    device_d = DeviceArray<float>(c.stream, std::span<const float>(d), "selftest");
    view = {device_x.data(), n, device_w.data(), n, device_d.data(), {}, static_cast<std::uint32_t>(n)};
  }
};

CheckResult check_lookup(const Context& c, bool halves) {
  const std::size_t n = c.items(1 << 16, 1 << 12);
  OctaOctree tree = make_octree(c.scene, 5);
  const std::span<float> table = tree.features();
  std::vector<Half> rounded(table.size());
  for (std::size_t i = 0; i < table.size(); ++i) {
    table[i] = 2.0f * Rng(c.seed + 1, RngPurpose::test, i).uniform() - 1.0f;
    rounded[i] = to_half(table[i]);
    if (halves) table[i] = to_float(rounded[i]);  // the definition reads what the device reads
  }
  const DeviceArray<float> floats(c.stream, halves ? std::span<const float>() : std::span<const float>(table),
                                  "selftest");
  const DeviceArray<Half> packed(c.stream, halves ? std::span<const Half>(rounded) : std::span<const Half>(),
                                 "selftest");
  const Queries queries(c, n);
  const DeviceOctree device(c.stream, tree);
  const auto rows = static_cast<std::size_t>(device.feature_count());
  const DeviceArray<float> out(c.stream, rows * n, "selftest");
  device.lookup(c.stream, {halves ? nullptr : floats.data(), halves ? packed.data() : nullptr}, queries.view,
                FloatRows{out.data(), n}, 0);
  const std::vector<float> got = out.download();
  std::vector<double> expected(rows), derivative(rows);
  Errors errors;
  for (std::size_t i = 0; i < n; ++i) {
    const Vec3d x(queries.x[i], queries.x[n + i], queries.x[2 * n + i]),
        w(queries.w[i], queries.w[n + i], queries.w[2 * n + i]);
    tree.lookup_reference(x, w, queries.d[i], expected.data(), derivative.data());
    for (std::size_t f = 0; f < rows; ++f) errors.add(std::fabs(got[f * n + i] - expected[f]));
  }
  // Where rounding puts a query into the next cell, or across a fold of the map, that level reads other entries.
  return errors.result("absolute error of features in [-1, 1]", 1e-3, 1e-3);
}

}  // namespace

CheckResult check_lookup_floats(const Context& c) { return check_lookup(c, false); }
CheckResult check_lookup_halves(const Context& c) { return check_lookup(c, true); }

namespace {

// All levels of a query; entries are halves. Their values do not matter, so they stay 0.
BenchmarkResult measure_lookup(const Context& c, bool sorted) {
  const int levels = c.stream.on_device() && !c.quick ? 8 : 5;
  const std::size_t n = c.items(1 << 21, 1 << 14);
  const OctaOctree tree = make_octree(c.scene, levels);
  DeviceArray<Half> table(c.stream, static_cast<std::size_t>(tree.entry_count()) * kFeatures, "selftest");
  table.fill(0);
  const Queries queries(c, n, sorted);
  const DeviceOctree device(c.stream, tree);
  const DeviceArray<std::uint32_t> out(c.stream, static_cast<std::size_t>(device.feature_count()) / 2 * n, "selftest");
  BenchmarkResult r = measure(c, static_cast<double>(n), "queries/s", [&] {
    device.lookup(c.stream, {nullptr, table.data()}, queries.view, HalfRows{out.data(), n}, 0);
  });
  r.sizes = {{"queries", static_cast<double>(n)},
             {"levels", levels},
             {"features", kFeatures},
             {"table_bytes", static_cast<double>(table.bytes())}};
  return r;
}

}  // namespace

BenchmarkResult benchmark_lookup(const Context& c) { return measure_lookup(c, false); }
BenchmarkResult benchmark_lookup_sorted(const Context& c) { return measure_lookup(c, true); }

}  // namespace octrad::selftest
