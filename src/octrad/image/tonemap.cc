#include "octrad/image/tonemap.h"

#include <algorithm>
#include <cmath>

#include "octrad/base/error.h"

namespace octrad {

Image8 tonemap(const Image& image, const ToneMapping& mapping, const std::string& layer) {
  const Image rgb = extract_rgb(image, layer);
  Image8 out(rgb.width, rgb.height, 3);
  std::transform(rgb.data.begin(), rgb.data.end(), out.data.begin(),
                 [&](float v) { return to_byte(tonemap(v, mapping)); });
  return out;
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

Image8 false_color(const Image& image, int channel, float lower, float upper) {
  if (!(lower < upper)) throw InputError("false colours need a lower end below the upper end");
  // Luminance rises evenly along the ramp.
  static constexpr Vec3f kRamp[] = {
      {0.0f, 0.0f, 0.0f}, {0.28f, 0.06f, 0.42f}, {0.72f, 0.16f, 0.40f}, {0.96f, 0.52f, 0.14f}, {1.0f, 1.0f, 0.92f}};
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
