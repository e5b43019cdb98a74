// Area-preserving maps from the unit square.
#pragma once

#include "octrad/base/vec.h"

namespace octrad {

// Uniform on the unit disk (Shirley & Chiu 1997, concentric).
OCTRAD_HD inline Vec2f square_to_disk(Vec2f u) {
  const float x = 2.0f * u.x - 1.0f, y = 2.0f * u.y - 1.0f;
  if (x == 0.0f && y == 0.0f) return {0.0f, 0.0f};
  const bool wide = std::fabs(x) > std::fabs(y);
  const float r = wide ? x : y;
  const float phi = wide ? 0.25f * kPi * (y / x) : 0.5f * kPi - 0.25f * kPi * (x / y);
  return {r * std::cos(phi), r * std::sin(phi)};
}

// Density cos / pi over the upper hemisphere.
OCTRAD_HD inline Vec3f square_to_cosine_hemisphere(Vec2f u) {
  const Vec2f d = square_to_disk(u);
  const float z2 = 1.0f - d.x * d.x - d.y * d.y;
  return {d.x, d.y, std::sqrt(z2 > 0.0f ? z2 : 0.0f)};
}

// Uniform barycentric coordinates (b1, b2) of a triangle (Heitz 2019, "A Low-Distortion Map Between Triangle and
// Square").
OCTRAD_HD inline Vec2f square_to_triangle(Vec2f u) {
  if (u.y > u.x) {
    const float x = 0.5f * u.x;
    return {x, u.y - x};
  }
  const float y = 0.5f * u.y;
  return {u.x - y, y};
}

}  // namespace octrad
