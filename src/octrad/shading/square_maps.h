// Area-preserving maps from the unit square.
#pragma once

#include "octrad/base/circle_math.h"

namespace octrad {

// Uniform on the unit disk (Shirley & Chiu 1997, concentric).
OCTRAD_HD inline Vec2f square_to_disk(Vec2f u) {
  const float x = 2.0f * u.x - 1.0f, y = 2.0f * u.y - 1.0f;
  const bool wide = std::fabs(x) > std::fabs(y);
  const float r = choose(wide, x, y), other = choose(wide, y, x);
  const Vec2f p = arc_point(0.25f * kPi * (other / (r == 0.0f ? 1.0f : r)));  // from the axis that r lies along
  return {r * choose(wide, p.x, p.y), r * choose(wide, p.y, p.x)};
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
  const bool above = u.y > u.x;
  const float half = 0.5f * choose(above, u.x, u.y);
  return {choose(above, half, u.x - half), choose(above, u.y - half, half)};
}

}  // namespace octrad
