// Rays and spheres. Distances are computed in double from the centre: coarser ones would not do to start new rays from.
#pragma once

#include <cmath>

#include "octrad/base/vec.h"

namespace octrad {

// Nearest distance in [t_min, t_max] or a negative number.
OCTRAD_HD inline double intersect_sphere(Vec3f center, float radius, Vec3f origin, Vec3f direction, float t_min,
                                         float t_max) {
  const Vec3d o = Vec3d(origin) - Vec3d(center), d(direction);
  const double r = static_cast<double>(radius);
  const double a = dot(d, d), b = dot(o, d);
  const Vec3d closest = o - d * (b / a);  // of the line to the centre: keeps the discriminant accurate far away
  const double h = r * r - dot(closest, closest);
  if (h < 0.0) return -1.0;
  const double root = std::sqrt(h / a), mid = -b / a;
  const double t_near = static_cast<double>(t_min), t_far = static_cast<double>(t_max);
  if (mid - root >= t_near) return mid - root <= t_far ? mid - root : -1.0;
  if (mid + root >= t_near && mid + root <= t_far) return mid + root;
  return -1.0;
}

// A little larger than the sphere, so that rounding loses no ray.
OCTRAD_HD inline Bounds3f sphere_bounds(Vec3f center, float radius) {
  const float grown = radius * (1.0f + 1e-5f), rounding = 2.4e-7f;
  const Vec3f r{grown + rounding * std::fabs(center.x), grown + rounding * std::fabs(center.y),
                grown + rounding * std::fabs(center.z)};
  Bounds3f b;
  b.lower = center - r;
  b.upper = center + r;
  return b;
}

}  // namespace octrad
