// A ray to cast, and its hit. Plain data, for host and device.
#pragma once

#include "octrad/base/vec.h"

namespace octrad {

// A ray from 0 to t_max.
struct RayQuery {
  Vec3f origin, direction;
  float t_max = 0.0f;
};

// Raw intersection. `primitive` and barycentrics (u, v) refer to the shape's mesh; spheres give the surface point
// itself.
struct Hit {
  int shape = -1;  // -1: nothing hit
  int primitive = -1;
  float t = 0.0f;
  float u = 0.0f, v = 0.0f;
  OCTRAD_HD constexpr bool valid() const { return shape >= 0; }
};

}  // namespace octrad
