// What the values of a picture mean, for pictures that are made of others. Internal to the module.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "octrad/image/image.h"
#include "octrad/image/tonemap.h"
#include "octrad/image/tonemap_math.h"

namespace octrad {

// Linear light of one value of a picture.
inline double linear_value(const Image& image, float value) {
  return is_display_referred(image) ? decode_srgb(static_cast<double>(value)) : static_cast<double>(value);
}

// The same of many values: what the 256 bytes mean is computed once, of which most pictures are.
class LinearValues {
 public:
  explicit LinearValues(const Image& image) : image_(&image) {
    for (int i = 0; i < 256; ++i) bytes_[i] = linear_value(image, static_cast<float>(i) / 255.0f);
  }
  double operator()(float value) const {
    const int byte = value >= 0.0f && value <= 1.0f ? static_cast<int>(std::lround(value * 255.0f)) : 0;
    return static_cast<float>(byte) / 255.0f == value ? bytes_[byte] : linear_value(*image_, value);
  }

 private:
  const Image* image_;
  double bytes_[256];
};

// Indices of R, G, B and A; grey pictures repeat theirs; -1 without alpha.
inline std::vector<int> color_channels(const Image& image) {
  int grey = image.channel("Y");
  if (grey < 0) grey = 0;
  std::vector<int> result;
  for (const char* name : {"R", "G", "B"}) result.push_back(image.channel(name) >= 0 ? image.channel(name) : grey);
  result.push_back(image.channel("A"));
  return result;
}

// Bilinear between the middles of four pixels; (x, y) in pixels from the corner of the picture, `at(x, y)` the value of
// a pixel, also beyond the edges.
template <typename At>
auto between_pixels(double x, double y, At&& at) {
  const double left = std::floor(x - 0.5), top = std::floor(y - 0.5), fx = x - 0.5 - left, fy = y - 0.5 - top;
  const int x0 = static_cast<int>(left), y0 = static_cast<int>(top);
  return (at(x0, y0) * (1.0 - fx) + at(x0 + 1, y0) * fx) * (1.0 - fy) +
         (at(x0, y0 + 1) * (1.0 - fx) + at(x0 + 1, y0 + 1) * fx) * fy;
}

// Colour at (u, v) in [0, 1]^2, from the upper left corner. Beyond its edges the picture repeats, or they go on.
inline Vec3d color_between(const Image& picture, double u, double v, bool repeats) {
  const auto inside = [&](int k, int n) { return repeats ? (k % n + n) % n : std::clamp(k, 0, n - 1); };
  return between_pixels(u * picture.width, v * picture.height, [&](int x, int y) {
    return Vec3d(picture.rgb(inside(x, picture.width), inside(y, picture.height)));
  });
}

}  // namespace octrad
