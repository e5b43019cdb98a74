// The multi-layer perceptron straight from its definition, in double, one query at a time: what the fast paths, the
// device's network and whole fields are tested against. Not part of the library.
#pragma once

#include <algorithm>
#include <cmath>
#include <span>
#include <vector>

#include "octrad/base/half.h"
#include "octrad/network/mlp.h"
#include "octrad/network/mlp_device.h"

namespace octrad::testing {

inline double as_half(double x) { return static_cast<double>(to_float(to_half(static_cast<float>(x)))); }

struct MlpReference {
  MlpShape shape;
  // Hidden activations, and the gradients at the output and at hidden layers, are rounded to halves where a DeviceMlp
  // does. Inputs and weights are rounded by given() and given_weights().
  bool halves = false;
  std::vector<std::vector<double>> activations = {};  // of the last forward(): input, hidden layers, linear output
  // With halves, of a DeviceMlp: how inputs come. `bias`: what of the first layer's sums the rounding of the weight of
  // 1 leaves.
  MlpInputMap map = {};
  std::vector<double> bias = {};

  // Weights and inputs as a DeviceMlp has them, in the units of the network.
  std::vector<double> given_weights(std::span<const float> from) {
    std::vector<double> to(from.begin(), from.end());
    if (!halves) return to;
    const auto inputs = static_cast<std::size_t>(shape.inputs);
    bias.assign(map.any() ? static_cast<std::size_t>(shape.width) : 0, 0.0);
    const auto mapped = [&](std::size_t o, int k) {
      return from[o * inputs + static_cast<std::size_t>(map.first + k)] / map.scale[k];
    };
    for (double& w : to) w = as_half(w);
    for (std::size_t o = 0; o < bias.size(); ++o) {
      float one = 0.0f;
      for (int k = 0; k < 3; ++k)
        one -= from[o * inputs + static_cast<std::size_t>(map.first + k)] * map.offset[k] / map.scale[k];
      bias[o] = as_half(static_cast<double>(one));
      for (int k = 0; k < 3; ++k) {
        const double w = as_half(static_cast<double>(mapped(o, k)));
        to[o * inputs + static_cast<std::size_t>(map.first + k)] = w * static_cast<double>(map.scale[k]);
        bias[o] += w * static_cast<double>(map.offset[k]);
      }
    }
    return to;
  }
  std::vector<double> given(std::vector<double> in) const {
    for (std::size_t k = 0; halves && k < in.size(); ++k) {
      const int axis = static_cast<int>(k) - map.first;
      if (!map.maps(static_cast<int>(k))) {
        in[k] = as_half(in[k]);
        continue;
      }
      const float come = static_cast<float>(in[k]) * map.scale[axis] + map.offset[axis];
      in[k] = (as_half(static_cast<double>(come)) - static_cast<double>(map.offset[axis])) /
              static_cast<double>(map.scale[axis]);
    }
    return in;
  }
  // Smallest |sum of w x| / sum of |w x| of a hidden neuron in the last forward(): how near it is to the edge of ReLU.
  double margin = 1.0;

  std::size_t layer_outputs(int l) const {
    return static_cast<std::size_t>(l == shape.hidden ? shape.outputs : shape.width);
  }

  // `weights` in the order of Mlp::weights(). Returns the linear output.
  const std::vector<double>& forward(const std::vector<double>& in, std::span<const double> weights) {
    activations = {in};
    margin = 1.0;
    std::size_t at = 0;
    for (int l = 0; l <= shape.hidden; ++l) {
      const std::vector<double>& x = activations.back();
      std::vector<double> y(layer_outputs(l));
      if (l == 0 && !bias.empty()) y = bias;
      for (double& out : y) {
        double size = std::abs(out);
        for (const double v : x) {
          const double term = weights[at++] * v;
          out += term;
          size += std::abs(term);
        }
        if (l == shape.hidden) continue;
        if (size > 0.0) margin = std::min(margin, std::abs(out) / size);
        out = std::max(out, 0.0);
        if (halves) out = as_half(out);
      }
      activations.push_back(std::move(y));
    }
    return activations.back();
  }

  // After forward(), for the gradient `dy` at the linear output: adds to d_weights, returns the gradient at the input.
  // `scale` multiplies gradients while they are halves.
  std::vector<double> backward(std::vector<double> dy, std::span<const double> weights, std::span<double> d_weights,
                               double scale = 1.0) const {
    if (halves) {
      for (double& d : dy) d = as_half(d * scale) / scale;
    }
    std::size_t end = weights.size();
    for (int l = shape.hidden; l >= 0; --l) {
      const std::vector<double>& x = activations[static_cast<std::size_t>(l)];
      const std::size_t begin = end - x.size() * dy.size();
      std::vector<double> dx(x.size());
      for (std::size_t o = 0; o < dy.size(); ++o) {
        for (std::size_t k = 0; k < x.size(); ++k) {
          d_weights[begin + o * x.size() + k] += dy[o] * x[k];
          dx[k] += dy[o] * weights[begin + o * x.size() + k];
        }
      }
      for (std::size_t k = 0; l > 0 && k < x.size(); ++k) {
        if (!(x[k] > 0.0)) dx[k] = 0.0;
        else if (halves) dx[k] = as_half(dx[k] * scale) / scale;
      }
      dy = std::move(dx);
      end = begin;
    }
    return dy;
  }
};

}  // namespace octrad::testing
