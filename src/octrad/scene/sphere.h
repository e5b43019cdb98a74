// An analytic sphere in world space. Plain data, for host and device.
#pragma once

#include "octrad/base/vec.h"

namespace octrad {

struct Sphere {
  Vec3f center;
  float radius = 1.0f;
  bool flip_normals = false;
  float to_local[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};  // row-major rotation world -> object, for uv
};

}  // namespace octrad
