// Networks and optimisers on a device against those of the CPU.
#pragma once

#include "octrad/device/check.h"
#include "octrad/network/mlp_device.h"

namespace octrad {

// A network of random weights, on the CPU (weights rounded to halves, as the device rounds them) and on a stream, and
// rows of random inputs that halves hold.
struct RandomMlp {
  std::size_t n;
  Mlp mlp;
  std::vector<float> inputs;  // [inputs][n]
  DeviceMlp device;
  DeviceArray<std::uint32_t> packed;

  // train_rows: as in DeviceMlp
  RandomMlp(Stream& stream, const MlpShape& shape, std::size_t rows, std::size_t train_rows, std::uint64_t seed);
  HalfRows in() const { return {packed.data(), n}; }
  // Two rows of `values` [rows][n] in a word; with an odd number, something in the place that is left.
  static std::vector<std::uint32_t> pack(std::span<const float> values, std::size_t n);
};

// Outputs, by their root mean square, against the CPU's network of floats.
CheckResult check_mlp_forward(Stream& stream, const MlpShape& shape, std::size_t n, std::uint64_t seed);

// The formula of one step of Adam.
CheckResult check_adam_update(Stream& stream, std::size_t n, std::uint64_t seed);
// Steps of a network's optimiser from a state that the CPU has made, some gradients of which are not usable; n > 18.
CheckResult check_dense_adam(Stream& stream, std::size_t n, std::uint64_t seed);
// Steps over a table of features, some contributions to which are not usable, summed as they come and in the CPU's
// order. Eight contributions a source.
enum class TableMode { touched, dense, dense_half_moments };
CheckResult check_table_adam(Stream& stream, std::size_t sources, TableMode mode, std::uint64_t seed);

}  // namespace octrad
