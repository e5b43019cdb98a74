// Rows (queries) a second of the networks of the method, and time a parameter or entry of Adam. The first argument is
// the number of threads. Items are rows for the networks. The CPU column adds up all threads: on a busy machine,
// estimate the rate of an idle one as threads times items over it.
#include <benchmark/benchmark.h>

#include <hwy/targets.h>

#include <vector>

#include "octrad/base/rng.h"
#include "octrad/base/threads.h"
#include "octrad/network/adam.h"
#include "octrad/network/mlp.h"
#include "octrad/network/mlp_simd.h"

namespace octrad {
namespace {

constexpr int kBlock = 512;  // rows a task, as the renderer and the trainer cut their batches
constexpr int kBlocks = 16;

constexpr MlpShape kDecoder{45, 128, 4, 3}, kRadiosity{45, 256, 4, 3}, kDisparity{28, 64, 2, 1};

std::vector<float> random_floats(std::size_t n) {
  Rng rng(1, RngPurpose::test, n);
  std::vector<float> v(n);
  for (float& x : v) x = 2.0f * rng.uniform() - 1.0f;
  return v;
}

void forward(benchmark::State& state, const MlpShape& shape) {
  set_thread_count(static_cast<int>(state.range(0)));
  Mlp mlp(shape);
  mlp.initialize(1, 0);
  constexpr int kRows = kBlock * kBlocks;
  const std::vector<float> in = random_floats(static_cast<std::size_t>(shape.inputs) * kRows);
  std::vector<float> out(static_cast<std::size_t>(shape.outputs) * kRows);
  for (auto _ : state) {
    parallel_for(kBlocks, [&](std::size_t b) {
      mlp.forward(in.data() + b * kBlock * static_cast<std::size_t>(shape.inputs), kBlock, kBlock,
                  out.data() + b * kBlock * static_cast<std::size_t>(shape.outputs));
    });
    benchmark::DoNotOptimize(out.data());
  }
  state.SetItemsProcessed(state.iterations() * kRows);
  state.SetLabel(network_simd_name());
  set_thread_count(0);
}

void forward_backward(benchmark::State& state, const MlpShape& shape) {
  set_thread_count(static_cast<int>(state.range(0)));
  Mlp mlp(shape);
  mlp.initialize(1, 0);
  const std::size_t inputs = static_cast<std::size_t>(shape.inputs), outputs = static_cast<std::size_t>(shape.outputs);
  constexpr int kRows = kBlock * kBlocks;
  const std::vector<float> in = random_floats(inputs * kRows), d_out = random_floats(outputs * kRows);
  std::vector<float> out(outputs * kRows), d_in(inputs * kRows);
  std::vector<std::vector<float>> d_weights(kBlocks, std::vector<float>(mlp.parameter_count()));
  std::vector<Mlp::Workspace> keep(kBlocks);
  for (auto _ : state) {
    parallel_for(kBlocks, [&](std::size_t b) {
      const float* x = in.data() + b * kBlock * inputs;
      mlp.forward(x, kBlock, kBlock, out.data() + b * kBlock * outputs, keep[b]);
      mlp.backward(x, d_out.data() + b * kBlock * outputs, keep[b], d_weights[b], d_in.data() + b * kBlock * inputs);
    });
    benchmark::DoNotOptimize(d_in.data());
  }
  state.SetItemsProcessed(state.iterations() * kRows);
  state.SetLabel(network_simd_name());
  set_thread_count(0);
}

// The decoder on each instruction set of this program and processor, best first (second argument: its place).
template <typename Body>
void on_target(benchmark::State& state, const Body& body) {
  const auto targets = hwy::SupportedAndGeneratedTargets();
  const auto index = static_cast<std::size_t>(state.range(1));
  if (index >= targets.size()) {
    state.SkipWithError("no such target here");
    return;
  }
  hwy::SetSupportedTargetsForTest(targets[index]);
  body(state, kDecoder);
  hwy::SetSupportedTargetsForTest(0);
}
void decoder_forward_on_target(benchmark::State& state) { on_target(state, forward); }
void decoder_forward_backward_on_target(benchmark::State& state) { on_target(state, forward_backward); }

BENCHMARK(decoder_forward_on_target)->ArgsProduct({{2}, {0, 1, 2, 3}})->MeasureProcessCPUTime()->UseRealTime();
BENCHMARK(decoder_forward_backward_on_target)->ArgsProduct({{2}, {0, 1, 2, 3}})->MeasureProcessCPUTime()->UseRealTime();
BENCHMARK_CAPTURE(forward, decoder, kDecoder)->Arg(1)->Arg(2)->MeasureProcessCPUTime()->UseRealTime();
BENCHMARK_CAPTURE(forward, radiosity, kRadiosity)->Arg(1)->Arg(2)->MeasureProcessCPUTime()->UseRealTime();
BENCHMARK_CAPTURE(forward, disparity, kDisparity)->Arg(1)->Arg(2)->MeasureProcessCPUTime()->UseRealTime();
BENCHMARK_CAPTURE(forward_backward, decoder, kDecoder)->Arg(1)->Arg(2)->MeasureProcessCPUTime()->UseRealTime();
BENCHMARK_CAPTURE(forward_backward, radiosity, kRadiosity)->Arg(1)->Arg(2)->MeasureProcessCPUTime()->UseRealTime();
BENCHMARK_CAPTURE(forward_backward, disparity, kDisparity)->Arg(1)->Arg(2)->MeasureProcessCPUTime()->UseRealTime();

// One step of 1024 queries x 8 levels x 12 contributions to a table of `entries` x 4 features: three vertices, two of
// them neighbours, for each of four cells. items_per_second counts touched entries.
void sparse_adam(benchmark::State& state, std::int64_t entries) {
  set_thread_count(static_cast<int>(state.range(0)));
  std::vector<float> table(static_cast<std::size_t>(entries) * 4);
  SparseAdam adam(entries, 4, {});
  for (float& m : adam.moments()) m = 1e-12f;  // pages exist, as after many steps
  for (std::uint16_t& c : adam.counts()) c = 5;
  constexpr std::uint32_t kQueries = 1024, kLevels = 8, kCells = 4, kBatches = 8;
  const std::vector<float> upstream = random_floats(kQueries * kLevels * 4);
  std::vector<std::vector<std::vector<SparseTap>>> batches(kBatches);
  Rng rng(3, RngPurpose::test, 0);
  for (auto& batch : batches) {
    batch.resize(kQueries / 64);
    for (std::uint32_t q = 0; q < kQueries; ++q) {
      for (std::uint32_t l = 0; l < kLevels; ++l) {
        for (std::uint32_t c = 0; c < kCells; ++c) {
          const std::uint32_t entry = rng.below(static_cast<std::uint32_t>(entries - 300));
          for (std::uint32_t at : {entry, entry + 1, entry + 257}) batch[q / 64].push_back({at, q * kLevels + l, 0.1f});
        }
      }
    }
  }
  std::int64_t touched = 0;
  std::size_t next = 0;
  for (auto _ : state) {
    const auto& batch = batches[next++ % kBatches];
    touched +=
        adam.step(table, std::vector<std::span<const SparseTap>>(batch.begin(), batch.end()), upstream, 1e-3).touched;
  }
  state.SetItemsProcessed(touched);
  state.counters["time_per_entry"] =
      benchmark::Counter(static_cast<double>(touched), benchmark::Counter::kIsRate | benchmark::Counter::kInvert);
  set_thread_count(0);
}

void dense_adam(benchmark::State& state, std::size_t parameters) {
  set_thread_count(static_cast<int>(state.range(0)));
  std::vector<float> p(parameters), g = random_floats(parameters);
  DenseAdam adam(parameters, {});
  for (auto _ : state) adam.step(p, g, 1e-3);
  const double total = static_cast<double>(state.iterations()) * static_cast<double>(parameters);
  state.counters["time_per_parameter"] =
      benchmark::Counter(total, benchmark::Counter::kIsRate | benchmark::Counter::kInvert);
  set_thread_count(0);
}

BENCHMARK_CAPTURE(sparse_adam, K8, 79'375'000)->Arg(1)->Arg(2)->MeasureProcessCPUTime()->UseRealTime();
BENCHMARK_CAPTURE(sparse_adam, K6, 3'526'245)->Arg(1)->Arg(2)->MeasureProcessCPUTime()->UseRealTime();
BENCHMARK_CAPTURE(dense_adam, decoder, 55'296)->Arg(1)->Arg(2)->MeasureProcessCPUTime()->UseRealTime();
BENCHMARK_CAPTURE(dense_adam, hash_grid, 6 * 2 * (std::size_t{1} << 19))
    ->Arg(1)
    ->Arg(2)
    ->MeasureProcessCPUTime()
    ->UseRealTime();

}  // namespace
}  // namespace octrad
