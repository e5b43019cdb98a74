// Geometry of a point of a surface. Plain data, for host and device.
#pragma once

#include "octrad/base/vec.h"

namespace octrad {

// Normals are on the side of the surface's own orientation, not flipped to the ray.
struct SurfaceInteraction {
  Vec3f position;
  Vec3f geometric_normal;  // unit
  Vec3f shading_normal;    // unit, interpolated (before bump mapping)
  Vec2f uv;
  Vec3f dp_du, dp_dv;
  int shape = -1, material = -1, emitter = -1;
  float t = 0.0f;
};

}  // namespace octrad
