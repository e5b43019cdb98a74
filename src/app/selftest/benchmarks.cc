#include <algorithm>
#include <bit>
#include <functional>

#include "app/selftest/memory_device.h"
#include "app/selftest/selftest.h"
#include "octrad/base/random_inputs.h"
#include "octrad/base/stopwatch.h"
#include "octrad/device/array.h"
#include "octrad/device/sort.h"
#include "octrad/network/checks.h"
#include "octrad/transport/checks.h"

namespace octrad::selftest {
namespace {

constexpr int kRuns = 9;
constexpr double kEnough = 2.0;  // seconds; slower work runs less often, three times at least

// Median of several runs after a warm one, by the stream's own clock. `count`: what one run does.
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

// Rays as training casts them: their nearest hit, or whether there is any.
BenchmarkResult trace(const Context& c, bool occlusion) {
  const std::size_t n = c.items(1 << 22, 1 << 16);
  const RayBatch rays(c.stream, c.soup, training_rays(c.soup, n, occlusion, c.seed));
  const DeviceArray<Hit> hits(c.stream, n, "selftest");
  const DeviceArray<std::uint32_t> blocked(c.stream, n, "selftest");
  BenchmarkResult r = measure(c, static_cast<double>(n), "rays/s", [&] {
    if (occlusion) rays.occluded(RayBatch::Traversal::warps, blocked.data());
    else rays.closest(RayBatch::Traversal::warps, hits.data());
  });
  r.sizes = {{"rays", static_cast<double>(n)}, {"triangles", static_cast<double>(c.soup.scene().triangle_count())}};
  return r;
}

BenchmarkResult sort(const Context& c) {
  const std::size_t n = c.items(1 << 22, 1 << 17);
  const std::vector<std::uint32_t> keys = testing::random_words(n, c.seed);
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
  run_nothing(c.stream);  // a kernel is loaded at its first launch, which must not be recorded
  const auto graph = c.stream.capture([&] {
    for (int i = 0; i < kLaunches; ++i) run_nothing(c.stream);
  });
  BenchmarkResult r = measure(c, kLaunches, "launches/s", [&] { c.stream.replay(*graph); });
  r.sizes = {{"launches", kLaunches}};
  return r;
}

// All levels of a query; entries are halves. Their values do not matter, so they stay 0.
BenchmarkResult look_up(const Context& c, bool sorted) {
  const int levels = c.large() ? 8 : 5;
  const std::size_t n = c.items(1 << 21, 1 << 14);
  const OctaOctree tree = make_octree(c, levels);
  DeviceArray<Half> table(c.stream, tree.features().size(), "selftest");
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

// With footprints of all sizes, at the size of Neural Cone Radiosity's grid; entries are halves.
BenchmarkResult look_up_footprints(const Context& c) {
  const std::size_t n = c.items(1 << 22, 1 << 14);
  const HashGrid grid(HashGridOptions{8, 8, c.large() ? 19 : 12, 4, 2.0});
  DeviceArray<Half> table(c.stream, grid.table().size(), "selftest");
  table.fill(0);
  const Vec3f origin = c.soup.scene().bounds.lower;
  const float size = max_component(c.soup.scene().bounds.extent());
  const LookupQueries places = surface_queries(c, n, false);
  std::vector<Vec3f> p;
  for (std::size_t i = 0; i < n; ++i) p.push_back((places.position(i) - origin) / size);
  const FootprintQueries queries(c.stream, p, c.seed);
  const DevicePrefilteredGrid device(grid);
  const DeviceArray<std::uint32_t> out(c.stream, static_cast<std::size_t>(device.features()) / 2 * n, "selftest");
  BenchmarkResult r = measure(c, static_cast<double>(n), "queries/s", [&] {
    device.lookup(c.stream, {nullptr, table.data()}, queries.view, HalfRows{out.data(), n}, 0);
  });
  r.sizes = {{"queries", static_cast<double>(n)}, {"table_bytes", static_cast<double>(table.bytes())}};
  return r;
}

// The decoder's network forward, or also backward with gradients of the weights and at all inputs: three times the
// products.
BenchmarkResult decode(const Context& c, bool training) {
  const std::size_t n = training ? c.items(1 << 18, 1 << 11) : c.items(1 << 21, 1 << 12);
  RandomMlp net(c.stream, kDecoder, n, training ? n : 0, c.seed);
  const std::vector<float> scale{1024.0f, 1.0f / 1024.0f};
  const DeviceArray<float> s(c.stream, std::span<const float>(scale), "selftest"), out(c.stream, 3 * n, "selftest"),
      d_in(c.stream, training ? net.inputs.size() : 0, "selftest");
  DeviceArray<float> d_out(c.stream, 3 * n, "selftest");
  d_out.fill(0);
  const double inputs = kDecoder.inputs, width = kDecoder.width, hidden = kDecoder.hidden,
               products = inputs * width + (hidden - 1.0) * width * width + width * kDecoder.outputs,
               flops = (training ? 6.0 : 2.0) * products;
  BenchmarkResult r = measure(c, flops * static_cast<double>(n), "FLOP/s", [&] {
    const auto count = static_cast<std::uint32_t>(n);
    const FloatRows to{out.data(), n};
    if (!training) return net.device.forward(c.stream, net.in(), to, count);
    net.device.forward_keep(c.stream, net.in(), to, count);
    net.device.backward(c.stream, net.in(), {d_out.data(), n}, s.data(), {d_in.data(), n}, kDecoder.inputs, count,
                        false);
  });
  r.sizes = {{"rows", static_cast<double>(n)},
             {"inputs", inputs},
             {"width", width},
             {"hidden", hidden},
             {"flop_a_row", flops},
             {"rows_a_second", static_cast<double>(n) / (r.median_ms * 1e-3)}};
  return r;
}

constexpr Benchmark kBenchmarks[] = {
    {"copy", copy_memory},
    {"random 32-byte reads, small table",
     [](const Context& c) { return sector_reads(c, c.items(16 * kMiB, kMiB / 4)); }},
    {"random 32-byte reads, large table",
     [](const Context& c) { return sector_reads(c, c.items(4096 * kMiB, 64 * kMiB)); }},
    {"divergent gathers", gathers},
    {"scatter-add, float", [](const Context& c) { return scatter(c, 1); }},
    {"scatter-add, four floats", [](const Context& c) { return scatter(c, 4); }},
    {"sort", sort},
    {"launches in a graph", graph_launches},
    {"rays, closest hit, as in training", [](const Context& c) { return trace(c, false); }},
    {"rays, occlusion, as in training", [](const Context& c) { return trace(c, true); }},
    {"feature lookup", [](const Context& c) { return look_up(c, false); }},
    {"feature lookup, sorted queries", [](const Context& c) { return look_up(c, true); }},
    {"lookup with footprints", look_up_footprints},
    {"decoder", [](const Context& c) { return decode(c, false); }},
    {"decoder, forward and backward", [](const Context& c) { return decode(c, true); }},
};

}  // namespace

std::span<const Benchmark> benchmarks() { return kBenchmarks; }

}  // namespace octrad::selftest
