#include "image/tonemap.h"

#include <algorithm>
#include <cmath>

#include "base/error.h"

namespace octrad {
namespace {

std::uint8_t to_byte(float unit) { return static_cast<std::uint8_t>(std::lround(std::clamp(unit, 0.0f, 1.0f) * 255.0f)); }

}  // namespace

float encode_srgb(float linear) {
  return linear <= 0.0031308f ? 12.92f * linear : 1.055f * std::pow(linear, 1.0f / 2.4f) - 0.055f;
}

float decode_srgb(float encoded) {
  return encoded <= 0.04045f ? encoded / 12.92f : std::pow((encoded + 0.055f) / 1.055f, 2.4f);
}

float tonemap(float value, const ToneMapping& mapping) {
  float v = value * std::exp2(mapping.exposure);
  if (!(v > 0.0f)) return 0.0f;  // negative or NaN
  if (mapping.curve == ToneMapping::Curve::log1p) v = std::log1p(v);
  v = std::min(v, 1.0f);
  switch (mapping.encoding) {
    case ToneMapping::Encoding::srgb: return encode_srgb(v);
    case ToneMapping::Encoding::gamma: return std::pow(v, 1.0f / mapping.gamma);
    case ToneMapping::Encoding::linear: break;
  }
  return v;
}

Image8 tonemap(const Image& image, const ToneMapping& mapping, const std::string& layer) {
  const Image rgb = extract_rgb(image, layer);
  Image8 out(rgb.width, rgb.height, 3);
  std::transform(rgb.data.begin(), rgb.data.end(), out.data.begin(), [&](float v) { return to_byte(tonemap(v, mapping)); });
  return out;
}

Image8 false_color(const Image& image, int channel, float lower, float upper) {
  if (!(lower < upper)) throw InputError("false colours need a lower end below the upper end");
  // Luminance rises evenly along the ramp.
  static constexpr Vec3f kRamp[] = {{0.0f, 0.0f, 0.0f}, {0.28f, 0.06f, 0.42f}, {0.72f, 0.16f, 0.40f}, {0.96f, 0.52f, 0.14f}, {1.0f, 1.0f, 0.92f}};
  constexpr int kSegments = static_cast<int>(std::size(kRamp)) - 1;
  Image8 out(image.width, image.height, 3);
  std::size_t at = 0;
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x, at += 3) {
      const float value = image.at(x, y, channel);
      Vec3f color(0.0f, 1.0f, 0.0f);
      if (std::isfinite(value)) {
        const float t = std::clamp((value - lower) / (upper - lower), 0.0f, 1.0f) * static_cast<float>(kSegments);
        const int segment = std::min(static_cast<int>(t), kSegments - 1);
        color = lerp(kRamp[segment], kRamp[segment + 1], Vec3f(t - static_cast<float>(segment)));
      }
      for (int c = 0; c < 3; ++c) out.data[at + static_cast<std::size_t>(c)] = to_byte(color[c]);
    }
  }
  return out;
}

}  // namespace octrad
