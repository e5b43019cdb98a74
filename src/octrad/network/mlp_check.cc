#include <cmath>

#include "octrad/base/random_inputs.h"
#include "octrad/network/checks.h"

namespace octrad {

std::vector<std::uint32_t> RandomMlp::pack(std::span<const float> values, std::size_t n) {
  const std::size_t rows = values.size() / n;
  std::vector<std::uint32_t> words((rows + 1) / 2 * n);
  for (std::size_t f = 0; f < rows; f += 2) {
    for (std::size_t i = 0; i < n; ++i)
      words[f / 2 * n + i] = pack_halves(values[f * n + i], f + 1 < rows ? values[(f + 1) * n + i] : 77.0f);
  }
  return words;
}

RandomMlp::RandomMlp(Stream& stream, const MlpShape& shape, std::size_t rows, std::size_t train_rows,
                     std::uint64_t seed)
    : n(rows),
      mlp(shape),
      inputs(testing::random_floats(static_cast<std::size_t>(shape.inputs) * rows, seed + 1)),
      device(stream, shape, train_rows, "check") {
  mlp.initialize(seed, 1);
  device.weights().upload(mlp.weights());
  device.refresh(stream);
  for (float& w : mlp.weights()) w = to_float(to_half(w));
  mlp.prepare();
  for (float& x : inputs) x = to_float(to_half(x));
  packed = DeviceArray<std::uint32_t>(stream, std::span<const std::uint32_t>(pack(inputs, n)), "inputs");
}

CheckResult check_mlp_forward(Stream& stream, const MlpShape& shape, std::size_t n, std::uint64_t seed) {
  const RandomMlp net(stream, shape, n, 0, seed);
  const DeviceArray<float> out(stream, static_cast<std::size_t>(shape.outputs) * n, "check");
  net.device.forward(stream, net.in(), {out.data(), n}, static_cast<std::uint32_t>(n));
  const std::vector<float> found = out.download();
  std::vector<float> expected(found.size());
  net.mlp.forward(net.inputs.data(), static_cast<int>(n), static_cast<int>(n), expected.data());
  double square = 0.0;
  for (const float e : expected) square += static_cast<double>(e) * e;
  const double size = std::sqrt(square / static_cast<double>(expected.size()));
  CheckErrors errors;
  for (std::size_t i = 0; i < found.size(); ++i)
    errors.add(std::fabs(static_cast<double>(found[i]) - expected[i]) / size);
  // Activations are rounded to 11 bits in every layer.
  CheckResult r = errors.result("error beside the float network", 1e-2);
  r.require(r.p50 < 1e-3, "too large a median error");
  return r;
}

}  // namespace octrad
