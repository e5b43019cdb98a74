#include "shading/environment_map.h"

#include <algorithm>
#include <cmath>

namespace octrad {
namespace {

constexpr float kOneMinus = 0.99999994f;

// Position in [0, 1] of a linear density from a (at 0) to b (at 1), by inversion of its integral.
float sample_linear(float a, float b, float u) {
  const float s = a + b;
  if (!(s > 0.0f)) return u;
  if (std::fabs(a - b) < 1e-4f * s) {  // nearly constant: avoid cancellation
    return u;
  }
  const float x = u * s / (a + std::sqrt(lerp(a * a, b * b, u)));
  return std::min(x, 1.0f);
}

}  // namespace

EnvironmentMap::EnvironmentMap(const Environment& environment)
    : map_(environment), width_(environment.width), height_(environment.height) {
  // A single row (or a constant) is the same at every latitude: handled as two equal rows of weight sin(theta) would be
  // zero everywhere, so such maps are sampled uniformly.
  if (height_ < 2) return;
  const std::size_t w = static_cast<std::size_t>(width_), h = static_cast<std::size_t>(height_);
  weights_.resize(w * h);
  for (std::size_t y = 0; y < h; ++y) {
    const double sin_theta = std::sin(3.14159265358979323846 * static_cast<double>(y) / static_cast<double>(h - 1));
    for (std::size_t x = 0; x < w; ++x) {
      weights_[y * w + x] = std::max(0.0f, luminance(map_.pixels[y * w + x])) * std::max(0.0f, static_cast<float>(sin_theta));
    }
  }
  row_cdf_.resize(h - 1);
  cell_cdf_.resize((h - 1) * w);
  double total = 0.0;
  for (std::size_t y = 0; y + 1 < h; ++y) {
    double row = 0.0;
    for (std::size_t x = 0; x < w; ++x) {
      const std::size_t n = x + 1 == w ? 0 : x + 1;
      row += 0.25 * (static_cast<double>(weights_[y * w + x]) + static_cast<double>(weights_[y * w + n]) +
                     static_cast<double>(weights_[(y + 1) * w + x]) + static_cast<double>(weights_[(y + 1) * w + n]));
      cell_cdf_[y * w + x] = static_cast<float>(row);
    }
    total += row;
    row_cdf_[y] = static_cast<float>(total);
  }
  if (total > 0.0) inv_integral_ = static_cast<float>(static_cast<double>((h - 1) * w) / total);
  // The mean over the sphere: integral of weight over (u, v), times 2 pi^2, over 4 pi.
  mean_ = static_cast<float>(total / static_cast<double>((h - 1) * w) * 3.14159265358979323846 / 2.0);
}

Vec3f EnvironmentMap::to_world(Vec3f v) const {
  const float* m = map_.to_world;
  return {m[0] * v.x + m[1] * v.y + m[2] * v.z, m[3] * v.x + m[4] * v.y + m[5] * v.z, m[6] * v.x + m[7] * v.y + m[8] * v.z};
}

Vec3f EnvironmentMap::to_map(Vec3f v) const {
  const float* m = map_.to_world;
  return {m[0] * v.x + m[3] * v.y + m[6] * v.z, m[1] * v.x + m[4] * v.y + m[7] * v.z, m[2] * v.x + m[5] * v.y + m[8] * v.z};
}

namespace {

Vec2f direction_to_uv(Vec3f d) {
  const float u = std::atan2(d.x, -d.z) * (0.5f * kInvPi);
  const float v = std::atan2(std::sqrt(d.x * d.x + d.z * d.z), d.y) * kInvPi;  // acos(y), accurate at the poles
  return {u - std::floor(u), v};
}

}  // namespace

EnvironmentMap::Cell EnvironmentMap::cell(Vec2f uv) const {
  const float w = static_cast<float>(width_);
  float x = uv.x * w - 0.5f;
  if (x < 0.0f) x += w;
  const float y = uv.y * static_cast<float>(height_ - 1);
  Cell c;
  c.x = std::clamp(static_cast<int>(x), 0, width_ - 1);
  c.y = std::clamp(static_cast<int>(y), 0, height_ - 2);
  c.fx = std::clamp(x - static_cast<float>(c.x), 0.0f, 1.0f);
  c.fy = std::clamp(y - static_cast<float>(c.y), 0.0f, 1.0f);
  return c;
}

float EnvironmentMap::bilinear_weight(const Cell& c) const {
  const int n = c.x + 1 == width_ ? 0 : c.x + 1;
  return lerp(lerp(weight(c.x, c.y), weight(n, c.y), c.fx), lerp(weight(c.x, c.y + 1), weight(n, c.y + 1), c.fx), c.fy);
}

Vec3f EnvironmentMap::bilinear_radiance(const Cell& c) const {
  const int n = c.x + 1 == width_ ? 0 : c.x + 1;
  const Vec3f* row0 = map_.pixels.data() + static_cast<std::size_t>(c.y) * static_cast<std::size_t>(width_);
  const Vec3f* row1 = row0 + width_;
  return (row0[c.x] * (1.0f - c.fx) + row0[n] * c.fx) * (1.0f - c.fy) + (row1[c.x] * (1.0f - c.fx) + row1[n] * c.fx) * c.fy;
}

Vec3f EnvironmentMap::radiance(Vec3f direction) const {
  if (height_ < 2) {
    if (width_ == 1) return map_.pixels[0];
    const Vec2f uv = direction_to_uv(to_map(direction));
    const float x = uv.x * static_cast<float>(width_) - 0.5f;
    const int i = static_cast<int>(std::floor(x));
    const float f = x - static_cast<float>(i);
    const Vec3f a = map_.pixels[static_cast<std::size_t>((i + width_) % width_)];
    const Vec3f b = map_.pixels[static_cast<std::size_t>((i + 1) % width_)];
    return a * (1.0f - f) + b * f;
  }
  return bilinear_radiance(cell(direction_to_uv(to_map(direction))));
}

float EnvironmentMap::pdf(Vec3f direction) const {
  if (height_ < 2) return 0.25f * kInvPi;
  const Vec3f d = to_map(direction);
  const float sin_theta = std::sqrt(d.x * d.x + d.z * d.z);
  if (!(sin_theta > 0.0f)) return 0.0f;
  return bilinear_weight(cell(direction_to_uv(d))) * inv_integral_ / (2.0f * kPi * kPi * sin_theta);
}

EnvironmentMap::Sample EnvironmentMap::sample(Vec2f u) const {
  Sample s;
  if (height_ < 2) {
    const float z = 1.0f - 2.0f * u.x, r = std::sqrt(std::max(0.0f, 1.0f - z * z)), phi = 2.0f * kPi * u.y;
    s.direction = {r * std::cos(phi), r * std::sin(phi), z};
    s.pdf = 0.25f * kInvPi;
    s.radiance = radiance(s.direction);
    return s;
  }
  if (!(inv_integral_ > 0.0f)) return s;
  // A cell in proportion to its integral (its four corners' mean), then a point of the bilinear density inside it. The
  // remainder of each random number is used again.
  const float target_row = std::min(u.y, kOneMinus) * row_cdf_.back();
  const std::size_t y = static_cast<std::size_t>(
      std::min<std::ptrdiff_t>(std::upper_bound(row_cdf_.begin(), row_cdf_.end(), target_row) - row_cdf_.begin(), height_ - 2));
  const float below_row = y > 0 ? row_cdf_[y - 1] : 0.0f;
  const float rest_y = std::clamp((target_row - below_row) / (row_cdf_[y] - below_row), 0.0f, kOneMinus);
  const float* cells = cell_cdf_.data() + y * static_cast<std::size_t>(width_);
  const float target = std::min(u.x, kOneMinus) * cells[width_ - 1];
  const std::size_t x = static_cast<std::size_t>(std::min<std::ptrdiff_t>(std::upper_bound(cells, cells + width_, target) - cells, width_ - 1));
  const float below = x > 0 ? cells[x - 1] : 0.0f;
  const float rest_x = std::clamp((target - below) / (cells[x] - below), 0.0f, kOneMinus);
  Cell c;
  c.x = static_cast<int>(x);
  c.y = static_cast<int>(y);
  const int n = c.x + 1 == width_ ? 0 : c.x + 1;
  const float w00 = weight(c.x, c.y), w10 = weight(n, c.y), w01 = weight(c.x, c.y + 1), w11 = weight(n, c.y + 1);
  c.fy = sample_linear(w00 + w10, w01 + w11, rest_y);
  c.fx = sample_linear(lerp(w00, w01, c.fy), lerp(w10, w11, c.fy), rest_x);
  const float phi = (static_cast<float>(c.x) + c.fx + 0.5f) / static_cast<float>(width_) * 2.0f * kPi;
  const float theta = (static_cast<float>(c.y) + c.fy) / static_cast<float>(height_ - 1) * kPi;
  const float sin_theta = std::sin(theta);
  if (!(sin_theta > 0.0f)) return s;
  s.direction = to_world({std::sin(phi) * sin_theta, std::cos(theta), -std::cos(phi) * sin_theta});
  s.radiance = bilinear_radiance(c);
  s.pdf = bilinear_weight(c) * inv_integral_ / (2.0f * kPi * kPi * sin_theta);
  return s;
}

}  // namespace octrad
