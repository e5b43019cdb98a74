// Reconstruction filter and sums of samples, for host and device.
#pragma once

#include <cmath>

#include "octrad/base/circle_math.h"
#include "octrad/base/vec.h"

namespace octrad {

inline constexpr int kPictureChannelCount = 11;
inline constexpr int kFilmNumbers = kPictureChannelCount + 1;  // channels, then weight

// What an integrator finds for one camera ray. Attributes are those of the first hit (method section 1); the values
// here where nothing is hit.
struct PixelSample {
  Vec3f radiance{0, 0, 0}, albedo{0, 0, 0}, normal{0, 0, 0};
  float depth = 0.0f;  // distance along the ray
  float roughness = 1.0f;
};

// A filter along one axis. Cubic ones and Lanczos' have negative lobes.
struct FilterShape {
  enum class Type { box, tent, gaussian, cubic, lanczos } type = Type::box;
  float radius = 0.5f;
  float exponent = 0.0f, floor = 0.0f;  // gaussian
  float b = 0.0f, c = 0.0f;             // cubic

  // At signed distance `d` in pixels.
  OCTRAD_HD float operator()(float d) const {
    const float a = std::fabs(d);
    if (type == Type::box) return a <= radius ? 1.0f : 0.0f;
    if (type == Type::tent) return std::fmax(0.0f, 1.0f - a / radius);
    if (a >= radius) return 0.0f;
    if (type == Type::gaussian) return std::fmax(0.0f, std::exp(exponent * d * d) - floor);
    return type == Type::cubic ? cubic(a) : sinc(a) * sinc(a / radius);
  }
  // Mitchell & Netravali 1988, "Reconstruction Filters in Computer Graphics".
  OCTRAD_HD float cubic(float a) const {
    const float a2 = a * a, a3 = a2 * a;
    if (a < 1.0f)
      return ((12.0f - 9.0f * b - 6.0f * c) * a3 + (-18.0f + 12.0f * b + 6.0f * c) * a2 + 6.0f - 2.0f * b) / 6.0f;
    return ((-b - 6.0f * c) * a3 + (6.0f * b + 30.0f * c) * a2 + (-12.0f * b - 48.0f * c) * a + 8.0f * b + 24.0f * c) /
           6.0f;
  }
  // sin(pi x) / (pi x), x >= 0.
  OCTRAD_HD static float sinc(float x) {
    return x < 1e-5f ? 1.0f : circle_point(0.5f * x - std::floor(0.5f * x)).y / (kPi * x);
  }
  // The pixels first .. last along the axis that a sample at `p` counts for.
  OCTRAD_HD int first(float p) const { return static_cast<int>(std::ceil(p - radius - 0.5f)); }
  OCTRAD_HD int last(float p) const { return static_cast<int>(std::floor(p + radius - 0.5f)); }
};

// A pixel's channel from its sums; 0 without samples.
OCTRAD_HD inline float pixel_mean(double sum, double weight) {
  return weight > 0.0 ? static_cast<float>(sum / weight) : 0.0f;
}

// Adds a sample to the sums of a pixel.
OCTRAD_HD inline void accumulate_sample(double* to, const PixelSample& s, double weight) {
  to[0] += weight * static_cast<double>(s.radiance.x);
  to[1] += weight * static_cast<double>(s.radiance.y);
  to[2] += weight * static_cast<double>(s.radiance.z);
  to[3] += weight * static_cast<double>(s.albedo.x);
  to[4] += weight * static_cast<double>(s.albedo.y);
  to[5] += weight * static_cast<double>(s.albedo.z);
  to[6] += weight * static_cast<double>(s.normal.x);
  to[7] += weight * static_cast<double>(s.normal.y);
  to[8] += weight * static_cast<double>(s.normal.z);
  to[9] += weight * static_cast<double>(s.depth);
  to[10] += weight * static_cast<double>(s.roughness);
  to[11] += weight;
}

}  // namespace octrad
