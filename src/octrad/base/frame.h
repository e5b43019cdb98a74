// Orthonormal frame around a normal (Duff et al. 2017, "Building an Orthonormal Basis, Revisited").
#pragma once

#include "octrad/base/vec.h"

namespace octrad {

struct Frame {
  Vec3f s, t, n;
  OCTRAD_HD Vec3f to_local(Vec3f v) const { return {dot(v, s), dot(v, t), dot(v, n)}; }
  OCTRAD_HD Vec3f to_world(Vec3f v) const { return s * v.x + t * v.y + n * v.z; }
};

// `n` must have unit length.
OCTRAD_HD inline Frame make_frame(Vec3f n) {
  const float sign = std::copysign(1.0f, n.z);
  const float a = -1.0f / (sign + n.z);
  const float b = n.x * n.y * a;
  return {{1.0f + sign * n.x * n.x * a, sign * b, -sign * n.x}, {b, sign + n.y * n.y * a, -n.y}, n};
}

// The frame of the unit normal `n` whose first axis follows `tangent` as far as it can.
OCTRAD_HD inline Frame tangent_frame(Vec3f n, Vec3f tangent) {
  const Vec3f s = tangent - n * dot(n, tangent);
  const float l2 = dot(s, s);
  if (!(l2 > 1e-24f && std::isfinite(l2))) return make_frame(n);
  const Vec3f unit = s / std::sqrt(l2);
  return {unit, cross(n, unit), n};
}

}  // namespace octrad
