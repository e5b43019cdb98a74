#include "app/selftest/entries.h"

namespace octrad::selftest {
namespace {

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

BenchmarkResult benchmark_decoder(const Context& c) {
  const std::size_t n = c.items(1 << 21, 1 << 12);
  const RandomMlp f(c.stream, kDecoder, n, 0, c.seed);
  const DeviceArray<float> out(c.stream, 3 * n, "selftest");
  const double per_row = flops(kDecoder);
  BenchmarkResult r = measure(c, per_row * static_cast<double>(n), "FLOP/s", [&] {
    f.device.forward(c.stream, f.in(), FloatRows{out.data(), n}, static_cast<std::uint32_t>(n));
  });
  add_sizes(r, n, per_row);
  return r;
}

// Forward, gradients of the weights and at all inputs: three times the products of forward alone.
BenchmarkResult benchmark_decoder_training(const Context& c) {
  const std::size_t n = c.items(1 << 18, 1 << 11);
  RandomMlp f(c.stream, kDecoder, n, n, c.seed);
  const DeviceArray<float> out(c.stream, 3 * n, "selftest");
  const std::vector<float> scale{1024.0f, 1.0f / 1024.0f};
  const DeviceArray<float> s(c.stream, std::span<const float>(scale), "selftest"),
      d_in(c.stream, f.inputs.size(), "selftest");
  DeviceArray<float> d_out(c.stream, 3 * n, "selftest");
  d_out.fill(0);
  const double per_row = 3.0 * flops(kDecoder);
  BenchmarkResult r = measure(c, per_row * static_cast<double>(n), "FLOP/s", [&] {
    const auto count = static_cast<std::uint32_t>(n);
    f.device.forward_keep(c.stream, f.in(), FloatRows{out.data(), n}, count);
    f.device.backward(c.stream, f.in(), FloatRows{d_out.data(), n}, s.data(), FloatRows{d_in.data(), n},
                      kDecoder.inputs, count, false);
  });
  add_sizes(r, n, per_row);
  return r;
}

}  // namespace octrad::selftest
