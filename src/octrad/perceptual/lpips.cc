#include "octrad/perceptual/lpips.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "octrad/base/error.h"
#include "octrad/base/threads.h"
#include "octrad/model/safetensors.h"
#include "octrad/network/mlp_simd.h"

namespace octrad {
namespace {

std::size_t size(int n) { return static_cast<std::size_t>(n); }

std::vector<float> read(const TensorReader& file, const std::string& name, const std::vector<std::int64_t>& shape) {
  const TensorReader::Tensor tensor = file.get(name, DType::f32, shape);
  std::vector<float> values(static_cast<std::size_t>(tensor.count));
  file.read(tensor, values.data());
  if (!std::all_of(values.begin(), values.end(), [](float v) { return std::isfinite(v); }))
    throw InputError(fmt::format("{}: tensor {} has values that are not finite", file.file(), name));
  return values;
}

Lpips::Tap empty_tap(int channels, int width, int height) {
  Lpips::Tap tap{channels, width, height, 0, {}};
  tap.stride = (size(width) * size(height) + kPanel - 1) / kPanel * kPanel;
  tap.values.resize(size(channels) * tap.stride);
  return tap;
}

int pooled(int side, bool round_up) {
  int out = (side - 3 + (round_up ? 1 : 0)) / 2 + 1;
  if (round_up && (out - 1) * 2 >= side) --out;  // a window must begin inside
  return out;
}

// Every pixel's vector of channels becomes v / (|v| + 1e-10).
void normalize(Lpips::Tap& tap) {
  parallel_blocks(tap.stride, 4096, [&](std::size_t begin, std::size_t end) {
    std::vector<float> sum(end - begin, 0.0f);
    for (std::size_t c = 0; c < size(tap.channels); ++c) {
      const float* v = &tap.values[c * tap.stride + begin];
      for (std::size_t i = 0; i < sum.size(); ++i) sum[i] += v[i] * v[i];
    }
    for (float& s : sum) s = 1.0f / (std::sqrt(s) + 1e-10f);
    for (std::size_t c = 0; c < size(tap.channels); ++c) {
      float* v = &tap.values[c * tap.stride + begin];
      for (std::size_t i = 0; i < sum.size(); ++i) v[i] *= sum[i];
    }
  });
}

// Weighted squared difference of two taps at each of its pixels.
std::vector<double> difference(const Lpips::Tap& a, const Lpips::Tap& b, const std::vector<float>& linear) {
  std::vector<double> map(size(a.width) * size(a.height), 0.0);
  parallel_blocks(map.size(), 4096, [&](std::size_t begin, std::size_t end) {
    for (std::size_t c = 0; c < size(a.channels); ++c) {
      const float *va = &a.values[c * a.stride], *vb = &b.values[c * b.stride];
      for (std::size_t i = begin; i < end; ++i) {
        const float d = va[i] - vb[i];
        map[i] += static_cast<double>(linear[c] * d * d);
      }
    }
  });
  return map;
}

// Where pixel `i` of `full` lies between pixels of a smaller side: the lower one and the weight of the next.
struct Between {
  std::size_t lower, upper;
  double weight;
};
Between between(std::size_t i, std::size_t full, std::size_t small) {
  const double at =
      std::max((static_cast<double>(i) + 0.5) * static_cast<double>(small) / static_cast<double>(full) - 0.5, 0.0);
  const std::size_t lower = std::min(static_cast<std::size_t>(at), small - 1);
  return {lower, std::min(lower + 1, small - 1), at - static_cast<double>(lower)};
}

double masked_mean(const std::vector<double>& map, const Lpips::Tap& tap, const Lpips::Features& picture,
                   std::span<const std::uint8_t> mask) {
  const std::size_t w = size(tap.width);
  double sum = 0.0;
  std::size_t count = 0;
  for (std::size_t y = 0; y < size(picture.height); ++y) {
    const Between row = between(y, size(picture.height), size(tap.height));
    for (std::size_t x = 0; x < size(picture.width); ++x) {
      if (mask[y * size(picture.width) + x] == 0) continue;
      const Between column = between(x, size(picture.width), w);
      const auto along_x = [&](std::size_t r) {
        return std::lerp(map[r * w + column.lower], map[r * w + column.upper], column.weight);
      };
      sum += std::lerp(along_x(row.lower), along_x(row.upper), row.weight);
      ++count;
    }
  }
  return sum / static_cast<double>(count);
}

}  // namespace

std::string lpips_file_name(LpipsNet net) {
  return net == LpipsNet::alex ? "lpips_alex_v0.1.safetensors" : "lpips_squeeze_v0.1.safetensors";
}

Lpips::Lpips(const std::string& folder, LpipsNet net) {
  const TensorReader file((folder.empty() ? "" : folder + "/") + lpips_file_name(net));
  // Names and numbers of the layers are torchvision's.
  const auto convolution = [&](const std::string& name, int inputs, int outputs, int kernel, int stride, int padding) {
    Convolution c{inputs, outputs, kernel, stride, padding, {}};
    const std::vector<float> weights = read(file, name + ".weight", {outputs, inputs, kernel, kernel});
    const std::vector<float> bias = read(file, name + ".bias", {outputs});
    const std::size_t depth = weights.size() / bias.size();
    for (std::size_t o = 0; o < bias.size(); ++o) {
      const auto row = weights.begin() + static_cast<std::ptrdiff_t>(o * depth);
      c.weights.insert(c.weights.end(), row, row + static_cast<std::ptrdiff_t>(depth));
      c.weights.push_back(bias[o]);
    }
    return c;
  };
  std::vector<int> channels;  // of the taps
  const auto add = [&](Layer layer) {
    if (layer.tap) channels.push_back(layer.parts.back().outputs * (layer.kind == Layer::Kind::fire ? 2 : 1));
    layers_.push_back(std::move(layer));
  };
  const auto add_pool = [&](bool round_up) { add({Layer::Kind::pool, round_up, false, {}}); };
  if (net == LpipsNet::alex) {
    const auto add_convolution = [&](int number, int inputs, int outputs, int kernel, int stride, int padding) {
      add({Layer::Kind::convolution,
           false,
           true,
           {convolution(fmt::format("features.{}", number), inputs, outputs, kernel, stride, padding)}});
    };
    add_convolution(0, 3, 64, 11, 4, 2);
    add_pool(false);
    add_convolution(3, 64, 192, 5, 1, 2);
    add_pool(false);
    add_convolution(6, 192, 384, 3, 1, 1);
    add_convolution(8, 384, 256, 3, 1, 1);
    add_convolution(10, 256, 256, 3, 1, 1);
  } else {
    const auto add_fire = [&](int number, int inputs, int squeeze, int expand, bool tap) {
      const std::string name = fmt::format("features.{}.", number);
      add({Layer::Kind::fire,
           false,
           tap,
           {convolution(name + "squeeze", inputs, squeeze, 1, 1, 0),
            convolution(name + "expand1x1", squeeze, expand, 1, 1, 0),
            convolution(name + "expand3x3", squeeze, expand, 3, 1, 1)}});
    };
    add({Layer::Kind::convolution, false, true, {convolution("features.0", 3, 64, 3, 2, 0)}});
    add_pool(true);
    add_fire(3, 64, 16, 64, false);
    add_fire(4, 128, 16, 64, true);
    add_pool(true);
    add_fire(6, 128, 32, 128, false);
    add_fire(7, 256, 32, 128, true);
    add_pool(true);
    add_fire(9, 256, 48, 192, true);
    add_fire(10, 384, 48, 192, true);
    add_fire(11, 384, 64, 256, true);
    add_fire(12, 512, 64, 256, true);
  }
  for (std::size_t i = 0; i < channels.size(); ++i)
    linear_.push_back(read(file, fmt::format("lin{}.model.1.weight", i), {1, channels[i], 1, 1}));
}

int Lpips::smallest_side() const {
  for (int side = 1;; ++side) {
    int n = side;
    for (const Layer& layer : layers_) {
      if (layer.kind == Layer::Kind::pool) {
        n = n < 3 ? 0 : pooled(n, layer.round_up);
      } else if (layer.kind == Layer::Kind::convolution) {
        const Convolution& c = layer.parts[0];
        const int room = n + 2 * c.padding - c.kernel;
        n = n < 1 || room < 0 ? 0 : room / c.stride + 1;
      }
    }
    if (n > 0) return side;
  }
}

// A matrix product of the weights and the pixels' neighbourhoods, gathered in panels of kPanel pixels.
Lpips::Tap Lpips::convolve(const Tap& in, const Convolution& c) {
  const int side_w = in.width + 2 * c.padding, side_h = in.height + 2 * c.padding;
  Tap out = empty_tap(c.outputs, (side_w - c.kernel) / c.stride + 1, (side_h - c.kernel) / c.stride + 1);
  const std::size_t plane = size(side_w) * size(side_h), depth = size(c.inputs) * size(c.kernel * c.kernel);
  std::vector<float> padded(size(c.inputs) * plane, 0.0f);
  parallel_for(size(c.inputs), [&](std::size_t channel) {
    for (std::size_t y = 0; y < size(in.height); ++y) {
      std::copy_n(&in.values[channel * in.stride + y * size(in.width)], in.width,
                  &padded[channel * plane + (y + size(c.padding)) * size(side_w) + size(c.padding)]);
    }
  });
  std::vector<std::size_t> offsets;  // of a neighbourhood's values from its first one
  offsets.reserve(depth);
  for (std::size_t channel = 0; channel < size(c.inputs); ++channel) {
    for (std::size_t y = 0; y < size(c.kernel); ++y) {
      for (std::size_t x = 0; x < size(c.kernel); ++x) offsets.push_back(channel * plane + y * size(side_w) + x);
    }
  }
  const std::size_t pixels = size(out.width) * size(out.height), panels = out.stride / kPanel;
  const std::size_t together = depth > 1024 ? 3 : 12;  // what is gathered stays in the second-level cache
  parallel_blocks(panels, together, [&](std::size_t begin, std::size_t end) {
    std::vector<float> gathered((end - begin) * (depth + 1) * kPanel);
    for (std::size_t panel = begin; panel < end; ++panel) {
      std::size_t first[kPanel];
      for (std::size_t j = 0; j < kPanel; ++j) {
        const std::size_t p = std::min(panel * kPanel + j, pixels - 1), w = size(out.width);
        first[j] = p / w * size(c.stride) * size(side_w) + p % w * size(c.stride);
      }
      float* to = &gathered[(panel - begin) * (depth + 1) * kPanel];
      for (std::size_t k = 0; k < depth; ++k, to += kPanel) {
        const float* from = padded.data() + offsets[k];
        for (std::size_t j = 0; j < kPanel; ++j) to[j] = from[first[j]];
      }
      std::fill_n(to, kPanel, 1.0f);  // times the bias
    }
    GemmArgs g;
    g.rows = size(c.outputs);
    g.depth = depth + 1;
    g.panels = end - begin;
    g.a = c.weights.data();
    g.a_stride = depth + 1;
    g.b = gathered.data();
    g.b_panel = (depth + 1) * kPanel;
    g.c = out.values.data() + begin * kPanel;
    g.c_stride = out.stride;
    g.post = GemmArgs::Post::relu;
    gemm(g);
  });
  return out;
}

Lpips::Tap Lpips::pool(const Tap& in, bool round_up) {
  Tap out = empty_tap(in.channels, pooled(in.width, round_up), pooled(in.height, round_up));
  parallel_for(size(in.channels), [&](std::size_t channel) {
    const float* from = &in.values[channel * in.stride];
    float* to = &out.values[channel * out.stride];
    for (int y = 0; y < out.height; ++y) {
      for (int x = 0; x < out.width; ++x) {
        float most = from[size(2 * y) * size(in.width) + size(2 * x)];
        for (int v = 2 * y; v < std::min(2 * y + 3, in.height); ++v) {
          for (int u = 2 * x; u < std::min(2 * x + 3, in.width); ++u)
            most = std::max(most, from[size(v) * size(in.width) + size(u)]);
        }
        to[size(y) * size(out.width) + size(x)] = most;
      }
    }
  });
  return out;
}

Lpips::Tap Lpips::run(const Tap& in, const Layer& layer) {
  if (layer.kind == Layer::Kind::pool) return pool(in, layer.round_up);
  Tap out = convolve(in, layer.parts[0]);
  if (layer.kind == Layer::Kind::fire) {
    const Tap squeezed = std::move(out);
    out = convolve(squeezed, layer.parts[1]);
    const Tap large = convolve(squeezed, layer.parts[2]);
    out.channels += large.channels;
    out.values.insert(out.values.end(), large.values.begin(), large.values.end());
  }
  return out;
}

Lpips::Features Lpips::features(const Image& displayed) const {
  if (const int least = smallest_side(); displayed.width < least || displayed.height < least)
    throw InputError(fmt::format("LPIPS needs pictures of at least {0} x {0} pixels", least));
  // From [0, 1] to [-1, 1], and to the mean and deviation of the pictures that the networks were trained with.
  constexpr float kShift[3] = {-0.030f, -0.088f, -0.188f}, kScale[3] = {0.458f, 0.448f, 0.450f};
  Tap now = empty_tap(3, displayed.width, displayed.height);
  for (std::size_t p = 0; p < displayed.pixel_count(); ++p) {
    for (std::size_t c = 0; c < 3; ++c)
      now.values[c * now.stride + p] = (2.0f * displayed.data[3 * p + c] - 1.0f - kShift[c]) / kScale[c];
  }
  Features features{displayed.width, displayed.height, {}};
  for (const Layer& layer : layers_) {
    now = run(now, layer);
    if (!layer.tap) continue;
    features.taps.push_back(now);
    normalize(features.taps.back());
  }
  return features;
}

double Lpips::distance(const Features& a, const Features& b, std::span<const std::uint8_t> mask) const {
  double total = 0.0;
  for (std::size_t t = 0; t < linear_.size(); ++t) {
    const std::vector<double> map = difference(a.taps[t], b.taps[t], linear_[t]);
    double mean = 0.0;
    if (mask.empty()) {
      for (const double v : map) mean += v;
      mean /= static_cast<double>(map.size());
    } else {
      mean = masked_mean(map, a.taps[t], a, mask);
    }
    total += mean;
  }
  return total;
}

}  // namespace octrad
