// Rows (queries) a second of the networks of the method, and nanoseconds a parameter or entry of Adam.
// The argument of every benchmark is the number of threads. Items are rows for the networks.
#include <benchmark/benchmark.h>

#include <vector>

#include "base/rng.h"
#include "base/threads.h"
#include "network/adam.h"
#include "network/mlp.h"
#include "network/mlp_kernels.h"

namespace octrad {
namespace {

constexpr int kBlock = 512;      // rows a task, as the renderer and the trainer cut their batches
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

BENCHMARK_CAPTURE(forward, decoder, kDecoder)->Arg(1)->Arg(2)->UseRealTime();
BENCHMARK_CAPTURE(forward, radiosity, kRadiosity)->Arg(1)->Arg(2)->UseRealTime();
BENCHMARK_CAPTURE(forward, disparity, kDisparity)->Arg(1)->Arg(2)->UseRealTime();
BENCHMARK_CAPTURE(forward_backward, decoder, kDecoder)->Arg(1)->Arg(2)->UseRealTime();
BENCHMARK_CAPTURE(forward_backward, radiosity, kRadiosity)->Arg(1)->Arg(2)->UseRealTime();
BENCHMARK_CAPTURE(forward_backward, disparity, kDisparity)->Arg(1)->Arg(2)->UseRealTime();

}  // namespace
}  // namespace octrad
