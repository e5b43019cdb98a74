// A multi-layer perceptron on a device: the network of mlp.h with halves as inputs, weights and activations, float sums
// and float weights to train. Where activations are chained in registers is in mlp_program.h; the host stream runs the
// same program with an emulated warp.
//
// Widths up to 256 (rounded up to 64, 128 or 256 with zeros), any number of inputs and outputs, at least one hidden
// layer.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "octrad/base/bytes.h"
#include "octrad/base/half.h"
#include "octrad/base/vec.h"
#include "octrad/device/array.h"
#include "octrad/device/rows.h"
#include "octrad/network/mlp.h"
#include "octrad/network/mlp_fragment_math.h"
#include "octrad/network/mlp_input_map.h"

namespace octrad {

class DeviceMlp {
 public:
  // train_rows: most rows of a backward pass; 0: only forward. `what` names the network in messages. Throws
  // MemoryError. A `map` needs an odd number of inputs: the one more is the free half of the last word.
  DeviceMlp(Stream& stream, const MlpShape& shape, std::size_t train_rows, const std::string& what,
            const MlpInputMap& map = {});
  // Memory that the constructor asks for.
  static std::vector<MemoryPart> memory(const MlpShape& shape, std::size_t train_rows, const std::string& what);

  const MlpShape& shape() const { return shape_; }
  const std::string& name() const { return what_; }
  std::size_t parameter_count() const { return weights_.size(); }
  // Weights in the order of Mlp::weights(). Call refresh() after they changed; refresh_all() does it in one launch.
  DeviceArray<float>& weights() { return weights_; }
  void refresh(Stream& stream);
  static void refresh_all(Stream& stream, std::span<DeviceMlp* const> networks);

  // Linear outputs of rows 0 .. n - 1 to out [outputs][stride]. in.stride and n as they are; rows that the queue does
  // not hold may be left out.
  void forward(Stream& stream, HalfRows in, FloatRows out, std::uint32_t n, QueueSlice slice = {}) const;
  // The same, keeping the activations for backward. n <= train_rows.
  void forward_keep(Stream& stream, HalfRows in, FloatRows out, std::uint32_t n);
  // After forward_keep on the same inputs: gradient at the linear outputs d_out [outputs][stride], taken times scale[0]
  // (in device memory; a power of 2 that brings the largest near 16, so that halves hold them and what layers make of
  // them) while they are halves, and times scale[1] = 1 / scale[0] afterwards. Writes the gradient at the first
  // d_inputs inputs to d_in (at mapped ones: at what they came as), unless that is 0, and adds the weights' gradient to
  // gradient() if `add`, else replaces it.
  // The same bits every time.
  void backward(Stream& stream, HalfRows in, FloatRows d_out, const float* scale, FloatRows d_in, int d_inputs,
                std::uint32_t n, bool add);
  DeviceArray<float>& gradient() { return gradient_; }

 private:
  int input_rows() const { return shape_.inputs + (map_.any() ? 1 : 0); }
  // Numbers in a part of the weights' gradient: a mapped network has one more input.
  std::size_t partial_stride() const { return weights_.size() + static_cast<std::size_t>(shape_.width); }

  DeviceInfo device_;  // whose shared memory holds the weights
  MlpShape shape_;
  MlpInputMap map_;
  MlpPlan plan_, reverse_;  // of the layers forwards, and of their transposes backwards
  std::string what_;
  std::size_t train_rows_ = 0;
  std::uint32_t splits_ = 0;  // of the rows of a weight gradient
  DeviceArray<float> weights_, gradient_, partial_;
  DeviceArray<std::uint32_t> packed_, packed_reverse_, activations_, gradients_;
};

}  // namespace octrad
