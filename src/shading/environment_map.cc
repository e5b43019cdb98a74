#include "shading/environment_map.h"

#include <algorithm>
#include <cmath>

#include "base/threads.h"

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
  sines_.resize(h);
  for (std::size_t y = 0; y < h; ++y) {
    sines_[y] = std::max(0.0f, static_cast<float>(std::sin(3.14159265358979323846 * static_cast<double>(y) / static_cast<double>(h - 1))));
  }
  rows_.resize(h - 1);
  cells_.resize((h - 1) * w);
  std::vector<double> row_weights(h - 1);
  parallel_for(h - 1, [&](std::size_t y) {
    std::vector<double> weights(w);
    const int iy = static_cast<int>(y);
    for (std::size_t x = 0; x < w; ++x) {
      const int ix = static_cast<int>(x), n = x + 1 == w ? 0 : ix + 1;
      weights[x] = 0.25 * (static_cast<double>(weight(ix, iy)) + static_cast<double>(weight(n, iy)) + static_cast<double>(weight(ix, iy + 1)) +
                           static_cast<double>(weight(n, iy + 1)));
      row_weights[y] += weights[x];
    }
    build_alias(weights.data(), width_, cells_.data() + y * w);
  });
  build_alias(row_weights.data(), height_ - 1, rows_.data());
  double total = 0.0;
  for (const double r : row_weights) total += r;
  if (total > 0.0) inv_integral_ = static_cast<float>(static_cast<double>((h - 1) * w) / total);
  // The mean over the sphere: integral of weight over (u, v), times 2 pi^2, over 4 pi.
  mean_ = static_cast<float>(total / static_cast<double>((h - 1) * w) * 3.14159265358979323846 / 2.0);
}

void EnvironmentMap::build_alias(const double* weights, int count, Alias* out) {
  double total = 0.0;
  for (int i = 0; i < count; ++i) total += weights[i];
  std::vector<double> scaled(static_cast<std::size_t>(count));
  std::vector<int> small, large;
  for (int i = 0; i < count; ++i) {
    const double s = total > 0.0 ? weights[i] * count / total : 1.0;
    scaled[static_cast<std::size_t>(i)] = s;
    (s < 1.0 ? small : large).push_back(i);
  }
  while (!small.empty() && !large.empty()) {
    const int s = small.back(), l = large.back();
    small.pop_back();
    out[s] = {static_cast<float>(scaled[static_cast<std::size_t>(s)]), l};
    double& rest = scaled[static_cast<std::size_t>(l)];
    rest -= 1.0 - scaled[static_cast<std::size_t>(s)];
    if (rest < 1.0) {
      large.pop_back();
      small.push_back(l);
    }
  }
  for (const std::vector<int>* rest : {&small, &large}) {
    for (const int i : *rest) out[i] = {1.0f, i};
  }
}

int EnvironmentMap::pick(const Alias* table, int count, float& u) {
  const float x = u * static_cast<float>(count);
  const int i = std::min(static_cast<int>(x), count - 1);
  const float rest = std::min(x - static_cast<float>(i), kOneMinus);
  const Alias a = table[i];
  if (rest < a.keep) {
    u = std::min(rest / a.keep, kOneMinus);
    return i;
  }
  u = std::min((rest - a.keep) / (1.0f - a.keep), kOneMinus);
  return a.other;
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
  return (texel(c.x, c.y) * (1.0f - c.fx) + texel(n, c.y) * c.fx) * (1.0f - c.fy) +
         (texel(c.x, c.y + 1) * (1.0f - c.fx) + texel(n, c.y + 1) * c.fx) * c.fy;
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

Vec3f EnvironmentMap::radiance(Vec3f direction, float& density) const {
  if (height_ < 2) {
    density = 0.25f * kInvPi;
    return radiance(direction);
  }
  const Vec3f d = to_map(direction);
  const float sin_theta = std::sqrt(d.x * d.x + d.z * d.z);
  const Cell c = cell(direction_to_uv(d));
  density = sin_theta > 0.0f ? bilinear_weight(c) * inv_integral_ / (2.0f * kPi * kPi * sin_theta) : 0.0f;
  return bilinear_radiance(c);
}

void EnvironmentMap::prefetch_table(Vec2f u) const {
  if (height_ < 2) return;
  const int y = pick(rows_.data(), height_ - 1, u.y);
  const int x = std::min(static_cast<int>(u.x * static_cast<float>(width_)), width_ - 1);
  __builtin_prefetch(cells_.data() + static_cast<std::size_t>(y) * static_cast<std::size_t>(width_) + x);
}

void EnvironmentMap::prefetch_pixels(Vec2f u) const {
  if (height_ < 2) return;
  const std::size_t y = static_cast<std::size_t>(pick(rows_.data(), height_ - 1, u.y)), w = static_cast<std::size_t>(width_);
  const std::size_t x = static_cast<std::size_t>(pick(cells_.data() + y * w, width_, u.x));
  __builtin_prefetch(map_.pixels.data() + y * w + x);
  __builtin_prefetch(map_.pixels.data() + (y + 1) * w + x);
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
  Cell c;
  c.y = pick(rows_.data(), height_ - 1, u.y);
  c.x = pick(cells_.data() + static_cast<std::size_t>(c.y) * static_cast<std::size_t>(width_), width_, u.x);
  const int n = c.x + 1 == width_ ? 0 : c.x + 1;
  const float w00 = weight(c.x, c.y), w10 = weight(n, c.y), w01 = weight(c.x, c.y + 1), w11 = weight(n, c.y + 1);
  c.fy = sample_linear(w00 + w10, w01 + w11, u.y);
  c.fx = sample_linear(lerp(w00, w01, c.fy), lerp(w10, w11, c.fy), u.x);
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
