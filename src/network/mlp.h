// Bias-free multi-layer perceptron with ReLU between layers (method section 5), fp32, run-time dispatched SIMD.
// Activations are feature-major: value f of query i is at [f * stride + i]; stride is a multiple of kMlpTile.
#pragma once

#include <span>
#include <vector>

namespace octrad {

inline constexpr int kMlpTile = 64;  // queries a tile; batches are padded to whole tiles by the caller (padding is ignored)

struct MlpShape {
  int inputs = 0;
  int width = 0;
  int hidden = 0;                  // hidden layers (width x width between them)
  int outputs = 0;
};

class Mlp {
 public:
  explicit Mlp(const MlpShape& shape);
  const MlpShape& shape() const { return shape_; }
  int layer_count() const { return shape_.hidden + 1; }
  int layer_inputs(int layer) const;
  int layer_outputs(int layer) const;
  // Weights of one layer, row-major [out][in]; all layers lie one after the other in weights().
  std::span<float> weights() { return weights_; }
  std::span<const float> weights() const { return weights_; }
  std::span<float> layer(int i);
  std::span<const float> layer(int i) const;
  std::size_t parameter_count() const { return weights_.size(); }
  // Xavier-uniform, keyed by seed and stream.
  void initialize(unsigned long long seed, unsigned long long stream);
  // Call after the weights changed (repacks for the kernels).
  void prepare();

  // n queries, any n <= stride. Linear output (the activation is the caller's). Thread-safe; no allocation when the
  // per-thread workspace is warm.
  void forward(const float* in, int n, int stride, float* out) const;

  // Forward that keeps what backward needs. One workspace per concurrently processed block.
  struct Workspace { std::vector<float> activations; int n = 0, stride = 0; };
  void forward(const float* in, int n, int stride, float* out, Workspace& keep) const;
  // d_out: gradient at the linear output [outputs][stride]; adds dW to d_weights (same layout as weights()), and writes
  // the gradient at the inputs to d_in [inputs][stride] unless it is null.
  void backward(const float* in, const float* d_out, const Workspace& kept, std::span<float> d_weights, float* d_in) const;

 private:
  MlpShape shape_;
  std::vector<float> weights_;
  std::vector<float> packed_;      // kernel layout
};

}  // namespace octrad
