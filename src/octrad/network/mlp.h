// Bias-free multi-layer perceptron with ReLU between layers (method section 5), fp32, run-time dispatched SIMD.
// Activations are feature-major: value f of query i is at [f * stride + i]. Padding (i >= n) is neither read nor
// written.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "octrad/network/aligned.h"

namespace octrad {

inline constexpr int kMlpTile = 64;  // queries that go through all layers together; fastest when n is a multiple of it
// Rounds a batch up to whole kernel tiles.
inline int padded(int n) { return (n + kMlpTile - 1) / kMlpTile * kMlpTile; }

struct MlpShape {
  int inputs = 0;
  int width = 0;
  int hidden = 0;  // hidden layers (width x width between them); 0: one linear layer
  int outputs = 0;

  bool operator==(const MlpShape&) const = default;
  std::size_t parameter_count() const {
    const int count = hidden == 0 ? inputs * outputs : width * (inputs + (hidden - 1) * width + outputs);
    return static_cast<std::size_t>(count);
  }
};

class Mlp {
 public:
  // Weights are zero until initialize() or until the caller fills weights().
  explicit Mlp(const MlpShape& shape);
  const MlpShape& shape() const { return shape_; }
  int layer_count() const { return shape_.hidden + 1; }
  int layer_inputs(int layer) const { return layer == 0 ? shape_.inputs : shape_.width; }
  int layer_outputs(int layer) const { return layer == shape_.hidden ? shape_.outputs : shape_.width; }
  // Weights of one layer, row-major [out][in]; all layers lie one after the other in weights().
  std::span<float> weights() { return weights_; }
  std::span<const float> weights() const { return weights_; }
  std::span<float> layer(int i);
  std::span<const float> layer(int i) const;
  std::size_t parameter_count() const { return weights_.size(); }
  // Xavier-uniform +-sqrt(6 / (in + out)), keyed by seed and stream; calls prepare().
  void initialize(unsigned long long seed, unsigned long long stream);
  // Call after the weights changed (repacks for the kernels). Not concurrently with the functions below.
  void prepare();

  // n queries, any n <= stride. Linear output (the activation is the caller's). Thread-safe; no allocation when the
  // per-thread workspace is warm. A query's result does not depend on n nor on the queries beside it (bit for bit;
  // AVX2 and AVX-512 give the same bits, processors without FMA others). in: [inputs][stride], out: [outputs][stride].
  void forward(const float* in, int n, int stride, float* out) const;

  // Forward that keeps what backward needs: the hidden activations, query-major. One workspace per concurrently
  // processed block; its memory is reused.
  struct Workspace {
    AlignedFloats activations;
    int n = 0, stride = 0;
  };
  void forward(const float* in, int n, int stride, float* out, Workspace& keep) const;
  // d_out: gradient at the linear output [outputs][stride]; adds dW, summed over the queries in order, to d_weights
  // (same layout as weights()), and writes the gradient at the inputs to d_in [inputs][stride] unless it is null.
  // `in` and the weights must be those of the forward that filled `kept`.
  void backward(const float* in, const float* d_out, const Workspace& kept, std::span<float> d_weights,
                float* d_in) const;

 private:
  std::size_t layer_offset(int layer) const;
  void forward_tiles(const float* in, int n, int stride, float* out, Workspace* keep) const;

  MlpShape shape_;
  std::vector<float> weights_;
  AlignedFloats packed_;                               // kernel layout: panels of 16 outputs, then panels of 16 inputs
  std::vector<std::size_t> forward_at_, backward_at_;  // where each layer's panels start in packed_
};

}  // namespace octrad
