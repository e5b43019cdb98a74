// Speed of look-ups, in a synthetic scene with about the paper's numbers of cells (bathroom: 2.5 M at level 8).
//   bench_encoding --benchmark_filter='lookup/K:8'
// Counter Mq/s: million queries a second of all threads together. (Benchmark's own items_per_second of several threads
// is per thread in some versions of the library.) Threads work on different queries of one table; "sorted" takes
// queries in Morton order, as a sorted batch would be.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <chrono>
#include <memory>

#include "octrad/base/morton.h"
#include "octrad/base/rng.h"
#include "octrad/encoding/cell_index.h"
#include "octrad/encoding/hash_grid.h"
#include "octrad/encoding/octaoctree.h"
#include "octrad/encoding/shell_cells_test_helper.h"

namespace octrad {
namespace {

constexpr int kPool = 1 << 18;  // queries
constexpr int kBatch = 1024;    // queries per call

struct Scene {
  explicit Scene(int levels) {
    const testing::ShellScene shell(12);
    tree = std::make_unique<OctaOctree>(OctaOctreeOptions{.levels = levels}, shell.cells(levels, 0.85), Vec3f(0.0f),
                                        Vec3f(1.0f));
    const std::span<float> table = tree->features();
    for (std::size_t i = 0; i < table.size(); ++i)
      table[i] = static_cast<float>(i & 255) * 0x1p-8f;  // touches every page
    Rng rng(1, RngPurpose::test, 31);
    for (int i = 0; i < kPool; ++i) {
      x[0].push_back(shell.point(rng));
      w.push_back(testing::ShellScene::direction(rng));
      d.push_back(2.0f * rng.uniform());
    }
    x[1] = x[0];
    const auto key = [](Vec3f p) { return morton_code({int(p.x * 512.0f), int(p.y * 512.0f), int(p.z * 512.0f)}); };
    std::sort(x[1].begin(), x[1].end(), [&](Vec3f a, Vec3f b) { return key(a) < key(b); });
  }
  std::unique_ptr<OctaOctree> tree;
  std::vector<Vec3f> x[2], w;
  std::vector<float> d;
};

// One scene exists at a time: K = 8 takes 1.2 GB. Made by set-up functions, before the threads start.
std::unique_ptr<Scene> g_scene;
int g_levels = 0;
std::unique_ptr<HashGrid> g_grid;

void setup(const benchmark::State& state) {
  const int levels = static_cast<int>(state.range(0));
  if (levels == g_levels) return;
  g_scene.reset();
  g_scene = std::make_unique<Scene>(levels);
  g_levels = levels;
}

// Reports the rate of a thread's loop; counters of several threads add up.
class Rate {
 public:
  explicit Rate(benchmark::State& state) : state_(state), start_(std::chrono::steady_clock::now()) {}
  ~Rate() {
    const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
    state_.counters["Mq/s"] = benchmark::Counter(static_cast<double>(state_.iterations()) * kBatch / seconds * 1e-6);
  }

 private:
  benchmark::State& state_;
  std::chrono::steady_clock::time_point start_;
};

// Batches of the pool, each thread its own.
int next_batch(int& at) {
  const int begin = at;
  at = (at + kBatch) % kPool;
  return begin;
}

void lookup(benchmark::State& state) {
  const Scene& scene = *g_scene;
  const std::vector<Vec3f>& x = scene.x[state.range(1)];
  std::vector<float> out(static_cast<std::size_t>(scene.tree->feature_count() * kBatch));
  int at = kPool / state.threads() * state.thread_index();
  const Rate rate(state);
  for (auto _ : state) {
    const int i = next_batch(at);
    benchmark::DoNotOptimize(scene.tree->lookup(&x[i], &scene.w[i], &scene.d[i], kBatch, out.data(), kBatch));
  }
  state.counters["entries"] =
      benchmark::Counter(static_cast<double>(scene.tree->entry_count()), benchmark::Counter::kAvgThreads);
}

void lookup_record(benchmark::State& state) {
  const Scene& scene = *g_scene;
  const std::vector<Vec3f>& x = scene.x[state.range(1)];
  std::vector<float> out(static_cast<std::size_t>(scene.tree->feature_count() * kBatch));
  OctaOctree::Record record;
  int at = kPool / state.threads() * state.thread_index();
  std::int64_t taps = 0;
  const Rate rate(state);
  for (auto _ : state) {
    const int i = next_batch(at);
    benchmark::DoNotOptimize(
        scene.tree->lookup_record(&x[i], &scene.w[i], &scene.d[i], kBatch, out.data(), kBatch, record));
    taps += static_cast<std::int64_t>(record.taps.size());
  }
  state.counters["taps"] = benchmark::Counter(
      static_cast<double>(taps) / static_cast<double>(state.iterations() * kBatch), benchmark::Counter::kAvgThreads);
}

BENCHMARK(lookup)
    ->Setup(setup)
    ->ArgNames({"K", "sorted"})
    ->ArgsProduct({{5, 6, 8}, {0, 1}})
    ->Threads(1)
    ->Threads(2)
    ->UseRealTime();
BENCHMARK(lookup_record)
    ->Setup(setup)
    ->ArgNames({"K", "sorted"})
    ->ArgsProduct({{5, 6, 8}, {0}})
    ->Threads(1)
    ->Threads(2)
    ->UseRealTime();

void setup_grid(const benchmark::State& state) {
  g_grid = std::make_unique<HashGrid>(HashGridOptions{.levels = static_cast<int>(state.range(0)),
                                                      .features = static_cast<int>(state.range(1)),
                                                      .log2_table = static_cast<int>(state.range(2))});
  testing::fill_random(g_grid->table(), 1);
}

void hash_grid(benchmark::State& state) {
  std::vector<Vec3f> p;
  const testing::ShellScene shell(12);
  Rng rng(2, RngPurpose::test, static_cast<std::uint64_t>(32 + state.thread_index()));
  for (int i = 0; i < kPool; ++i) p.push_back(shell.point(rng));
  std::vector<float> out(static_cast<std::size_t>(g_grid->feature_count() * kBatch));
  int at = 0;
  const Rate rate(state);
  for (auto _ : state) {
    g_grid->lookup(&p[static_cast<std::size_t>(next_batch(at))], kBatch, out.data(), kBatch);
    benchmark::DoNotOptimize(out.data());
  }
}
BENCHMARK(hash_grid)
    ->Setup(setup_grid)
    ->ArgNames({"levels", "features", "log2_table"})
    ->Args({6, 2, 17})
    ->Args({6, 2, 19})
    ->Args({4, 8, 19})
    ->Threads(1)
    ->Threads(2)
    ->UseRealTime();

}  // namespace
}  // namespace octrad
