#include "octrad/network/mlp.h"

#include <algorithm>
#include <cassert>
#include <cmath>

#include "octrad/base/rng.h"
#include "octrad/network/mlp_simd.h"

// Inside, activations of a tile are query-major [query][feature]: then the output of every product below (forward,
// gradient of activations, gradient of weights) is written as the next one reads it, without a transpose. Only the
// narrow network output and the optional gradient at the inputs are turned around for the caller's layout.

namespace octrad {
namespace {

constexpr std::size_t kRowsAtOnce = kMlpTile;

std::size_t panels_for(std::size_t features) { return (features + kPanel - 1) / kPanel; }

// Floats from one query to the next. An odd number of cache lines, so that a column of a tile does not fall into few
// cache sets.
std::size_t row_stride(std::size_t features) { return (panels_for(features) | 1) * kPanel; }

struct Scratch {
  AlignedFloats tiles, gradients;
};

Scratch& scratch() {
  thread_local Scratch s;
  return s;
}

float* grown(AlignedFloats& buffer, std::size_t size) {
  if (buffer.size() < size) buffer.resize(size);
  return buffer.data();
}

std::size_t as_size(int x) { return static_cast<std::size_t>(x); }

}  // namespace

Mlp::Mlp(const MlpShape& shape) : shape_(shape) {
  assert(shape.inputs > 0 && shape.outputs > 0 && shape.hidden >= 0 && (shape.hidden == 0 || shape.width > 0));
  std::size_t packed = 0;
  for (int l = 0; l < layer_count(); ++l) {
    const std::size_t in = as_size(layer_inputs(l)), out = as_size(layer_outputs(l));
    forward_at_.push_back(packed);
    packed += panels_for(out) * kPanel * in;
    backward_at_.push_back(packed);
    packed += panels_for(in) * kPanel * out;
  }
  weights_.assign(shape.parameter_count(), 0.0f);
  packed_.assign(packed, 0.0f);
}

std::size_t Mlp::layer_offset(int layer) const {
  std::size_t offset = 0;
  for (int l = 0; l < layer; ++l) offset += as_size(layer_inputs(l)) * as_size(layer_outputs(l));
  return offset;
}

std::span<float> Mlp::layer(int i) {
  return std::span<float>(weights_).subspan(layer_offset(i), as_size(layer_inputs(i)) * as_size(layer_outputs(i)));
}

std::span<const float> Mlp::layer(int i) const {
  return std::span<const float>(weights_).subspan(layer_offset(i),
                                                  as_size(layer_inputs(i)) * as_size(layer_outputs(i)));
}

void Mlp::initialize(unsigned long long seed, unsigned long long stream) {
  Rng rng(seed, RngPurpose::weights, stream);
  for (int l = 0; l < layer_count(); ++l) {
    const float bound = std::sqrt(6.0f / static_cast<float>(layer_inputs(l) + layer_outputs(l)));
    for (float& w : layer(l)) w = bound * (2.0f * rng.uniform() - 1.0f);
  }
  prepare();
}

void Mlp::prepare() {
  for (int l = 0; l < layer_count(); ++l) {
    const std::size_t in = as_size(layer_inputs(l)), out = as_size(layer_outputs(l));
    const std::span<const float> w = layer(l);
    float* forward = packed_.data() + forward_at_[as_size(l)];
    for (std::size_t o = 0; o < out; ++o) {
      float* column = forward + o / kPanel * kPanel * in + o % kPanel;
      for (std::size_t k = 0; k < in; ++k) column[k * kPanel] = w[o * in + k];
    }
    float* backward = packed_.data() + backward_at_[as_size(l)];
    for (std::size_t p = 0; p < panels_for(in); ++p) {
      const std::size_t count = std::min(kPanel, in - p * kPanel);
      for (std::size_t o = 0; o < out; ++o) {
        std::copy_n(w.data() + o * in + p * kPanel, count, backward + p * kPanel * out + o * kPanel);
      }
    }
  }
}

void Mlp::forward(const float* in, int n, int stride, float* out) const { forward_tiles(in, n, stride, out, nullptr); }

void Mlp::forward(const float* in, int n, int stride, float* out, Workspace& keep) const {
  keep.n = n;
  keep.stride = stride;
  grown(keep.activations, as_size(shape_.hidden) * as_size(n) * row_stride(as_size(shape_.width)));
  forward_tiles(in, n, stride, out, &keep);
}

void Mlp::forward_tiles(const float* in, int n, int stride, float* out, Workspace* keep) const {
  assert(n >= 0 && n <= stride);
  const std::size_t outputs = as_size(shape_.outputs), queries = as_size(n), in_stride = as_size(stride);
  const std::size_t wide = row_stride(as_size(shape_.width)), narrow = panels_for(outputs) * kPanel;
  float* tiles = grown(scratch().tiles, kRowsAtOnce * (2 * wide + narrow));
  for (std::size_t i = 0; i < queries; i += kRowsAtOnce) {
    const std::size_t rows = std::min(kRowsAtOnce, queries - i);
    GemmArgs g;
    g.rows = rows;
    g.a = in + i;
    g.a_stride = in_stride;
    g.a_transposed = true;
    for (int l = 0; l < layer_count(); ++l) {
      const bool last = l == shape_.hidden;
      g.depth = as_size(layer_inputs(l));
      g.panels = panels_for(as_size(layer_outputs(l)));
      g.b = packed_.data() + forward_at_[as_size(l)];
      g.b_panel = g.depth * kPanel;
      g.post = last ? GemmArgs::Post::store : GemmArgs::Post::relu;
      g.c_stride = last ? narrow : wide;
      if (last) {
        g.c = tiles + 2 * kRowsAtOnce * wide;
      } else if (keep != nullptr) {
        g.c = keep->activations.data() + (as_size(l) * queries + i) * wide;
      } else {
        g.c = tiles + static_cast<std::size_t>(l & 1) * kRowsAtOnce * wide;
      }
      gemm(g);
      g.a = g.c;
      g.a_stride = wide;
      g.a_transposed = false;
    }
    for (std::size_t o = 0; o < outputs; ++o) {
      for (std::size_t r = 0; r < rows; ++r) out[o * in_stride + i + r] = g.c[r * narrow + o];
    }
  }
}

void Mlp::backward(const float* in, const float* d_out, const Workspace& kept, std::span<float> d_weights,
                   float* d_in) const {
  assert(d_weights.size() == weights_.size());
  const std::size_t queries = as_size(kept.n), stride = as_size(kept.stride);
  const std::size_t inputs = as_size(shape_.inputs), outputs = as_size(shape_.outputs);
  const std::size_t wide = row_stride(as_size(shape_.width));
  const std::size_t tile_stride = std::max({wide, row_stride(outputs), row_stride(inputs)});
  if (queries == 0) return;

  // Sums of dW over the tiles. Layers after the first: [out][in padded]; the first: [in][out padded], because its
  // input is feature-major, which serves as the broadcast operand but not as the vector operand.
  std::vector<std::size_t>& at = [&]() -> std::vector<std::size_t>& {
    thread_local std::vector<std::size_t> a;
    return a;
  }();
  at.clear();
  std::size_t total = 0;
  for (int l = 0; l < layer_count(); ++l) {
    at.push_back(total);
    const std::size_t vectors = as_size(l == 0 ? layer_outputs(l) : layer_inputs(l));
    total += as_size(l == 0 ? layer_inputs(l) : layer_outputs(l)) * panels_for(vectors) * kPanel;
  }
  float* sums = grown(scratch().gradients, total);
  float* tiles = grown(scratch().tiles, 2 * kRowsAtOnce * tile_stride);

  for (std::size_t i = 0; i < queries; i += kRowsAtOnce) {
    const std::size_t rows = std::min(kRowsAtOnce, queries - i);
    float* dy = tiles;
    float* dx = tiles + kRowsAtOnce * tile_stride;
    std::size_t dy_stride = row_stride(outputs);
    for (std::size_t r = 0; r < rows; ++r) {
      for (std::size_t o = 0; o < outputs; ++o) dy[r * dy_stride + o] = d_out[o * stride + i + r];
      for (std::size_t o = outputs; o < panels_for(outputs) * kPanel; ++o) dy[r * dy_stride + o] = 0.0f;
    }
    for (int l = shape_.hidden; l >= 0; --l) {
      const std::size_t layer_in = as_size(layer_inputs(l)), layer_out = as_size(layer_outputs(l));
      const float* x = l == 0 ? nullptr : kept.activations.data() + (as_size(l - 1) * queries + i) * wide;

      GemmArgs w;  // dW
      w.depth = rows;
      w.post = i == 0 ? GemmArgs::Post::store : GemmArgs::Post::accumulate;
      w.c = sums + at[as_size(l)];
      w.b_panel = kPanel;
      if (l == 0) {
        w.rows = layer_in;
        w.panels = panels_for(layer_out);
        w.a = in + i;
        w.a_stride = stride;
        w.b = dy;
        w.b_stride = dy_stride;
      } else {
        w.rows = layer_out;
        w.panels = panels_for(layer_in);
        w.a = dy;
        w.a_stride = dy_stride;
        w.a_transposed = true;
        w.b = x;
        w.b_stride = wide;
      }
      w.c_stride = w.panels * kPanel;
      gemm(w);
      if (l == 0 && d_in == nullptr) break;

      GemmArgs g;  // gradient at this layer's input, through the ReLU before it
      g.rows = rows;
      g.depth = layer_out;
      g.panels = panels_for(layer_in);
      g.a = dy;
      g.a_stride = dy_stride;
      g.b = packed_.data() + backward_at_[as_size(l)];
      g.b_panel = layer_out * kPanel;
      g.c = dx;
      g.c_stride = row_stride(layer_in);
      g.mask = x;
      g.mask_stride = wide;
      g.post = l == 0 ? GemmArgs::Post::store : GemmArgs::Post::masked;
      gemm(g);
      std::swap(dx, dy);
      dy_stride = g.c_stride;
    }
    if (d_in != nullptr) {
      for (std::size_t k = 0; k < inputs; ++k) {
        for (std::size_t r = 0; r < rows; ++r) d_in[k * stride + i + r] = dy[r * dy_stride + k];
      }
    }
  }

  float* d = d_weights.data();
  for (int l = 0; l < layer_count(); ++l) {
    const std::size_t layer_in = as_size(layer_inputs(l)), layer_out = as_size(layer_outputs(l));
    const float* sum = sums + at[as_size(l)];
    const std::size_t columns = panels_for(l == 0 ? layer_out : layer_in) * kPanel;
    for (std::size_t o = 0; o < layer_out; ++o) {
      if (l == 0) {
        for (std::size_t k = 0; k < layer_in; ++k) d[o * layer_in + k] += sum[k * columns + o];
      } else {
        for (std::size_t k = 0; k < layer_in; ++k) d[o * layer_in + k] += sum[o * columns + k];
      }
    }
    d += layer_in * layer_out;
  }
}

}  // namespace octrad
