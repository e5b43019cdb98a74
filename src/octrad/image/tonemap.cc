#include "octrad/image/tonemap.h"

#include <algorithm>
#include <cmath>
#include <span>

#include "octrad/base/error.h"

namespace octrad {

Image8 tonemap(const Image& image, const ToneMapping& mapping, const std::string& layer) {
  const Image rgb = layer.empty() ? linear_color(image) : extract_rgb(image, layer);
  Image8 out(rgb.width, rgb.height, 3);
  std::transform(rgb.data.begin(), rgb.data.end(), out.data.begin(),
                 [&](float v) { return to_byte(tonemap(v, mapping)); });
  return out;
}

bool is_display_referred(const Image& image) {
  const auto encoding = image.metadata.find("encoding");
  return encoding != image.metadata.end() && encoding->second == "srgb8";
}

Image linear_color(const Image& image) {
  Image rgb = extract_rgb(image);
  if (is_display_referred(image)) {
    for (float& v : rgb.data) v = decode_srgb(v);
    rgb.metadata["encoding"] = "linear";
  }
  return rgb;
}

Image display_color(const Image& image) {
  Image rgb = extract_rgb(image);
  if (is_display_referred(image)) return rgb;
  for (float& v : rgb.data) v = tonemap(v, ToneMapping());
  rgb.metadata["encoding"] = "srgb8";
  return rgb;
}

Image shown_linear_color(const Image& image) {
  Image rgb = linear_color(image);
  for (float& v : rgb.data) v = v > 0.0f ? std::min(v, 1.0f) : 0.0f;
  return rgb;
}

bool is_vector_layer(const Image& image, const std::string& layer) {
  return !layer.empty() && image.channel(layer + ".X") >= 0;
}

Image8 vector_color(const Image& image, const std::string& layer, float lower, float upper) {
  if (!(lower < upper)) throw InputError("a range needs a lower end below the upper end");
  const Image vectors = extract_rgb(image, layer);
  Image8 out(image.width, image.height, 3);
  for (std::size_t i = 0; i < out.data.size(); i += 3) {
    const float* v = &vectors.data[i];
    if (v[0] == 0.0f && v[1] == 0.0f && v[2] == 0.0f) continue;
    for (std::size_t c = 0; c < 3; ++c) out.data[i + c] = to_byte((v[c] - lower) / (upper - lower));
  }
  return out;
}

namespace {

// One channel through `ramp`, from t = 0 to 1; green where it is not finite.
template <typename T>
Image8 colored(const Image& image, int channel, std::span<const Vec3f> ramp, T t_of) {
  const int segments = static_cast<int>(ramp.size()) - 1;
  Image8 out(image.width, image.height, 3);
  std::size_t at = 0;
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x, at += 3) {
      const float value = image.at(x, y, channel);
      Vec3f color(0.0f, 1.0f, 0.0f);
      if (std::isfinite(value)) {
        const float t = std::clamp(t_of(value), 0.0f, 1.0f) * static_cast<float>(segments);
        const int segment = std::min(static_cast<int>(t), segments - 1);
        const std::size_t first = static_cast<std::size_t>(segment);
        color = lerp(ramp[first], ramp[first + 1], Vec3f(t - static_cast<float>(segment)));
      }
      for (int c = 0; c < 3; ++c) out.data[at + static_cast<std::size_t>(c)] = to_byte(color[c]);
    }
  }
  return out;
}

}  // namespace

Image8 false_color(const Image& image, int channel, float lower, float upper) {
  if (!(lower < upper) || !std::isfinite(upper - lower))
    throw InputError("false colours need a lower end below the upper end, and a finite distance between them");
  return colored(image, channel, kFalseColors, [&](float value) { return (value - lower) / (upper - lower); });
}

Image8 signed_color(const Image& image, int channel, float limit) {
  if (!(limit > 0.0f)) throw InputError("colours of signed values need a limit above 0");
  return colored(image, channel, kSignedColors, [&](float value) { return 0.5f + 0.5f * value / limit; });
}

}  // namespace octrad
