#include <algorithm>
#include <bit>
#include <numeric>

#include "app/selftest/entries.h"
#include "app/selftest/kernels.h"
#include "app/selftest/rays.h"
#include "app/selftest/selftest.h"
#include "octrad/base/rng.h"
#include "octrad/base/stopwatch.h"
#include "octrad/device/array.h"
#include "octrad/device/sort.h"

namespace octrad::selftest {
namespace {

constexpr int kRuns = 9;
constexpr double kEnough = 2.0;  // seconds; slower work runs less often, three times at least

}  // namespace

BenchmarkResult measure(const Context& c, double count, const std::string& unit, const std::function<void()>& work) {
  work();
  c.stream.synchronize();
  std::vector<double> ms;
  const Stopwatch watch;
  while (ms.size() < kRuns && (ms.size() < 3 || watch.seconds() < kEnough)) {
    const auto begin = c.stream.record();
    work();
    const auto end = c.stream.record();
    ms.push_back(c.stream.milliseconds(*begin, *end));
  }
  std::sort(ms.begin(), ms.end());
  BenchmarkResult r;
  r.median_ms = ms[ms.size() / 2];
  r.min_ms = ms.front();
  r.max_ms = ms.back();
  r.runs = static_cast<int>(ms.size());
  r.unit = unit;
  r.rate = r.median_ms > 0.0 ? count / (r.median_ms * 1e-3) : 0.0;
  return r;
}

namespace {

// Largest power of two of items of this size within the bytes wanted and a quarter of what is free.
std::size_t table_items(const Context& c, std::size_t wanted_bytes, std::size_t item_bytes) {
  return std::bit_floor(std::min(wanted_bytes, c.stream.info().free_bytes / 4) / item_bytes);
}

constexpr std::size_t kMiB = std::size_t{1} << 20;

BenchmarkResult copy_memory(const Context& c) {
  const std::size_t bytes = table_items(c, c.items(1024 * kMiB, 32 * kMiB), 1);
  DeviceArray<unsigned char> from(c.stream, bytes, "selftest"), to(c.stream, bytes, "selftest");
  from.fill(1);
  BenchmarkResult r = measure(c, 2.0 * static_cast<double>(bytes), "B/s read and written",
                              [&] { c.stream.copy(to.data(), from.data(), bytes); });
  r.sizes = {{"bytes", static_cast<double>(bytes)}};
  return r;
}

BenchmarkResult sector_reads(const Context& c, std::size_t table_bytes) {
  const std::size_t entries = table_items(c, table_bytes, sizeof(Sector)), n = c.items(1 << 23, 1 << 17);
  DeviceArray<Sector> table(c.stream, entries, "selftest");
  const DeviceArray<float> out(c.stream, n, "selftest");
  table.fill(0);
  BenchmarkResult r = measure(c, static_cast<double>(n) * kAccesses, "sectors/s", [&] {
    run_sector_reads(c.stream, n, table.data(), static_cast<std::uint32_t>(entries - 1), out.data());
  });
  r.sizes = {{"table_bytes", static_cast<double>(table.bytes())}, {"reads", static_cast<double>(n) * kAccesses}};
  return r;
}

BenchmarkResult sector_reads_small(const Context& c) { return sector_reads(c, c.items(16 * kMiB, kMiB / 4)); }
BenchmarkResult sector_reads_large(const Context& c) { return sector_reads(c, c.items(4096 * kMiB, 64 * kMiB)); }

BenchmarkResult gathers(const Context& c) {
  const std::size_t entries = table_items(c, c.items(1024 * kMiB, 32 * kMiB), sizeof(float)),
                    n = c.items(1 << 23, 1 << 17);
  DeviceArray<float> table(c.stream, entries, "selftest");
  const DeviceArray<float> out(c.stream, n, "selftest");
  table.fill(0);
  BenchmarkResult r = measure(c, static_cast<double>(n) * kAccesses, "loads/s of 4 bytes", [&] {
    run_gathers(c.stream, n, table.data(), static_cast<std::uint32_t>(entries - 1), out.data());
  });
  r.sizes = {{"table_bytes", static_cast<double>(table.bytes())}, {"loads", static_cast<double>(n) * kAccesses}};
  return r;
}

BenchmarkResult scatter(const Context& c, int width) {
  const std::size_t entry = static_cast<std::size_t>(width) * sizeof(float);
  const std::size_t entries = table_items(c, c.items(512 * kMiB, 16 * kMiB), entry), n = c.items(1 << 22, 1 << 16);
  DeviceArray<float> table(c.stream, entries * static_cast<std::size_t>(width), "selftest");
  table.fill(0);
  const auto mask = static_cast<std::uint32_t>(entries - 1);
  BenchmarkResult r =
      measure(c, static_cast<double>(n) * kAccesses, width == 1 ? "adds/s of 4 bytes" : "adds/s of 16 bytes", [&] {
        if (width == 1) run_scatter(c.stream, n, table.data(), mask);
        else run_scatter4(c.stream, n, table.data(), mask);
      });
  r.sizes = {{"table_bytes", static_cast<double>(table.bytes())}, {"adds", static_cast<double>(n) * kAccesses}};
  return r;
}

BenchmarkResult scatter1(const Context& c) { return scatter(c, 1); }
BenchmarkResult scatter4(const Context& c) { return scatter(c, 4); }

BenchmarkResult closest(const Context& c) {
  const RayFixture rays(c, c.items(1 << 22, 1 << 16));
  const DeviceArray<Hit> hits(c.stream, rays.size(), "selftest");
  BenchmarkResult r = measure(c, static_cast<double>(rays.size()), "rays/s",
                              [&] { run_closest(c.stream, rays.size(), rays.bvh(), rays.data(), hits.data()); });
  r.sizes = {{"rays", static_cast<double>(rays.size())}, {"triangles", static_cast<double>(c.scene.triangle_count())}};
  return r;
}

BenchmarkResult occlusion(const Context& c) {
  const RayFixture rays(c, c.items(1 << 22, 1 << 16), true);
  const DeviceArray<std::uint32_t> blocked(c.stream, rays.size(), "selftest");
  BenchmarkResult r = measure(c, static_cast<double>(rays.size()), "rays/s",
                              [&] { run_occluded(c.stream, rays.size(), rays.bvh(), rays.data(), blocked.data()); });
  r.sizes = {{"rays", static_cast<double>(rays.size())}, {"triangles", static_cast<double>(c.scene.triangle_count())}};
  return r;
}

BenchmarkResult sort(const Context& c) {
  const std::size_t n = c.items(1 << 22, 1 << 17);
  std::vector<std::uint32_t> keys(n);
  for (std::size_t i = 0; i < n; ++i) keys[i] = Rng(c.seed, RngPurpose::test, i).bits();
  const SortWorkspace workspace(c.stream, n, "selftest");
  const DeviceArray<std::uint32_t> in(c.stream, std::span<const std::uint32_t>(keys), "selftest"),
      keys_out(c.stream, n, "selftest"), values_out(c.stream, n, "selftest");
  BenchmarkResult r = measure(c, static_cast<double>(n), "pairs/s", [&] {
    sort_pairs(c.stream, workspace, n, in.data(), keys_out.data(), in.data(), values_out.data());
  });
  r.sizes = {{"pairs", static_cast<double>(n)}, {"bits", 32.0}};
  return r;
}

// Empty kernels of a recorded graph: what a launch costs at least.
BenchmarkResult graph_launches(const Context& c) {
  constexpr int kLaunches = 1000;
  const auto graph = c.stream.capture([&] {
    for (int i = 0; i < kLaunches; ++i) run_nothing(c.stream);
  });
  BenchmarkResult r = measure(c, kLaunches, "launches/s", [&] { c.stream.replay(*graph); });
  r.sizes = {{"launches", kLaunches}};
  return r;
}

constexpr Benchmark kBenchmarks[] = {
    {"copy", copy_memory},
    {"random 32-byte reads, small table", sector_reads_small},
    {"random 32-byte reads, large table", sector_reads_large},
    {"divergent gathers", gathers},
    {"scatter-add, float", scatter1},
    {"scatter-add, four floats", scatter4},
    {"sort", sort},
    {"launches in a graph", graph_launches},
    {"rays, closest hit, incoherent", closest},
    {"rays, occlusion, incoherent", occlusion},
    {"feature lookup", benchmark_lookup},
    {"feature lookup, sorted queries", benchmark_lookup_sorted},
    {"decoder", benchmark_decoder},
    {"decoder, forward and backward", benchmark_decoder_training},
};

}  // namespace

std::span<const Benchmark> benchmarks() { return kBenchmarks; }

}  // namespace octrad::selftest
