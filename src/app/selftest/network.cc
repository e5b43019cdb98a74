#include <algorithm>
#include <cmath>

#include "app/selftest/entries.h"
#include "octrad/base/half.h"
#include "octrad/base/rng.h"
#include "octrad/device/array.h"
#include "octrad/network/mlp.h"
#include "octrad/network/mlp_device.h"

namespace octrad::selftest {
namespace {

constexpr MlpShape kDecoder{45, 128, 4, 3};

std::vector<float> random_inputs(std::size_t n, std::uint64_t seed) {
  std::vector<float> values(static_cast<std::size_t>(kDecoder.inputs) * n);
  for (std::size_t i = 0; i < values.size(); ++i)
    values[i] = to_float(to_half(2.0f * Rng(seed, RngPurpose::test, i).uniform() - 1.0f));
  return values;
}

// Rows 2 r and 2 r + 1 of an item in one word.
std::vector<std::uint32_t> packed(const std::vector<float>& values, std::size_t n) {
  const std::size_t rows = values.size() / n;
  std::vector<std::uint32_t> words((rows + 1) / 2 * n, 0);
  for (std::size_t f = 0; f < rows; ++f) {
    for (std::size_t i = 0; i < n; ++i)
      words[f / 2 * n + i] |= std::uint32_t{to_half(values[f * n + i]).bits} << (f % 2 * 16);
  }
  return words;
}

// The network with random weights on the stream, and inputs for it.
struct Fixture {
  Mlp mlp{kDecoder};
  std::vector<float> inputs;
  DeviceMlp device;
  DeviceArray<std::uint32_t> in;
  DeviceArray<float> out;
  HalfRows rows;

  Fixture(const Context& c, std::size_t n, bool training)
      : inputs(random_inputs(n, c.seed)),
        device(c.stream, kDecoder, training ? n : 0, "selftest") {
    mlp.initialize(c.seed, 1);
    for (float& w : mlp.weights()) w = to_float(to_half(w));  // as the device rounds them
    mlp.prepare();
    device.weights().upload(mlp.weights());
    device.refresh(c.stream);
    in = DeviceArray<std::uint32_t>(c.stream, std::span<const std::uint32_t>(packed(inputs, n)), "selftest");
    out = DeviceArray<float>(c.stream, 3 * n, "selftest");
    rows = {in.data(), n};
  }
};

double flops(const MlpShape& s) {
  return 2.0 * (static_cast<double>(s.inputs) * s.width + (s.hidden - 1.0) * s.width * s.width +
                static_cast<double>(s.width) * s.outputs);
}

void add_sizes(BenchmarkResult& r, std::size_t n, double per_row) {
  r.sizes = {{"rows", static_cast<double>(n)}, {"inputs", kDecoder.inputs},
             {"width", kDecoder.width},        {"hidden", kDecoder.hidden},
             {"flop_a_row", per_row},          {"rows_a_second", static_cast<double>(n) / (r.median_ms * 1e-3)}};
}

}  // namespace

CheckResult check_decoder(const Context& c) {
  const std::size_t n = c.items(1 << 16, 1 << 11);
  Fixture f(c, n, false);
  f.device.forward(c.stream, f.rows, FloatRows{f.out.data(), n}, static_cast<std::uint32_t>(n));
  const std::vector<float> got = f.out.download();
  std::vector<float> expected(3 * n);
  f.mlp.forward(f.inputs.data(), static_cast<int>(n), static_cast<int>(n), expected.data());
  Errors errors;
  for (std::size_t i = 0; i < got.size(); ++i) errors.add(std::fabs(static_cast<double>(got[i]) - expected[i]));
  return errors.result("error beside the float network", 1e-2);  // activations are rounded to 11 bits in every layer
}

BenchmarkResult benchmark_decoder(const Context& c) {
  const std::size_t n = c.items(1 << 21, 1 << 12);
  Fixture f(c, n, false);
  const double per_row = flops(kDecoder);
  BenchmarkResult r = measure(c, per_row * static_cast<double>(n), "FLOP/s", [&] {
    f.device.forward(c.stream, f.rows, FloatRows{f.out.data(), n}, static_cast<std::uint32_t>(n));
  });
  add_sizes(r, n, per_row);
  return r;
}

// Forward, gradients of the weights and at all inputs: three times the products of forward alone.
BenchmarkResult benchmark_decoder_training(const Context& c) {
  const std::size_t n = c.items(1 << 18, 1 << 11);
  Fixture f(c, n, true);
  const std::vector<float> scale{1024.0f, 1.0f / 1024.0f};
  const DeviceArray<float> s(c.stream, std::span<const float>(scale), "selftest"),
      d_in(c.stream, f.inputs.size(), "selftest");
  DeviceArray<float> d_out(c.stream, 3 * n, "selftest");
  d_out.fill(0);
  const double per_row = 3.0 * flops(kDecoder);
  BenchmarkResult r = measure(c, per_row * static_cast<double>(n), "FLOP/s", [&] {
    const auto count = static_cast<std::uint32_t>(n);
    f.device.forward_keep(c.stream, f.rows, FloatRows{f.out.data(), n}, count);
    f.device.backward(c.stream, f.rows, FloatRows{d_out.data(), n}, s.data(), FloatRows{d_in.data(), n},
                      kDecoder.inputs, count, false);
  });
  add_sizes(r, n, per_row);
  return r;
}

}  // namespace octrad::selftest
