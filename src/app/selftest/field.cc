#include <algorithm>

#include "app/selftest/entries.h"
#include "octrad/base/rng.h"
#include "octrad/geometry/surface_sampling.h"
#include "octrad/geometry/voxelize.h"

namespace octrad::selftest {

OctaOctree make_octree(const Scene& scene, int levels) {
  const Domain domain = scene_domain(scene.bounds, true);
  return OctaOctree({levels, 4}, occupied_cells(scene, domain, levels), domain.origin, domain.size);
}

LookupQueries surface_queries(const Context& c, std::size_t n, bool sorted) {
  const SurfaceSampler sampler(c.scene);
  const Domain domain = scene_domain(c.scene.bounds, true);
  std::vector<Vec3f> positions(n);
  for (std::size_t i = 0; i < n; ++i) {
    Rng rng(c.seed, RngPurpose::test, i);
    const float pick = rng.uniform();
    positions[i] = sampler.sample_position(pick, rng.uniform2());
  }
  // Keys of 15 bits, as a sort of queries would have them.
  if (sorted)
    std::ranges::stable_sort(positions, {}, [&](Vec3f p) {
      const Vec3f cell = (p - domain.origin) / domain.size * 32.0f;
      return morton_key({static_cast<int>(cell.x), static_cast<int>(cell.y), static_cast<int>(cell.z)});
    });
  return LookupQueries(c.stream, positions, 4.0f / length(c.scene.bounds.extent()), c.seed + 2);
}

namespace {

// All levels of a query; entries are halves. Their values do not matter, so they stay 0.
BenchmarkResult measure_lookup(const Context& c, bool sorted) {
  const int levels = c.stream.on_device() && !c.quick ? 8 : 5;
  const std::size_t n = c.items(1 << 21, 1 << 14);
  const OctaOctree tree = make_octree(c.scene, levels);
  DeviceArray<Half> table(c.stream, static_cast<std::size_t>(tree.entry_count() * tree.options().features), "selftest");
  table.fill(0);
  const LookupQueries queries = surface_queries(c, n, sorted);
  const DeviceOctree device(c.stream, tree);
  const DeviceArray<std::uint32_t> out(c.stream, static_cast<std::size_t>(device.feature_count()) / 2 * n, "selftest");
  BenchmarkResult r = measure(c, static_cast<double>(n), "queries/s", [&] {
    device.lookup(c.stream, {nullptr, table.data()}, queries.view, HalfRows{out.data(), n}, 0);
  });
  r.sizes = {{"queries", static_cast<double>(n)},
             {"levels", levels},
             {"features", tree.options().features},
             {"table_bytes", static_cast<double>(table.bytes())}};
  return r;
}

}  // namespace

BenchmarkResult benchmark_lookup(const Context& c) { return measure_lookup(c, false); }
BenchmarkResult benchmark_lookup_sorted(const Context& c) { return measure_lookup(c, true); }

}  // namespace octrad::selftest
