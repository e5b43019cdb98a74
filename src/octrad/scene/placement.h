// Where an instance puts a mesh that it shares with others. Plain data, for host and device.
#pragma once

#include "octrad/base/vec.h"

namespace octrad {

struct Placement {
  float to_world[12] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};  // row-major 3 x 4, affine
  float normals[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};             // row-major: carries normals, up to their length
  bool mirrors = false;                                       // the determinant is negative

  OCTRAD_HD Vec3f point(Vec3f p) const {
    const float* m = to_world;
    return {m[0] * p.x + m[1] * p.y + m[2] * p.z + m[3], m[4] * p.x + m[5] * p.y + m[6] * p.z + m[7],
            m[8] * p.x + m[9] * p.y + m[10] * p.z + m[11]};
  }
  OCTRAD_HD Vec3f normal(Vec3f n) const {
    const float* m = normals;
    return {m[0] * n.x + m[1] * n.y + m[2] * n.z, m[3] * n.x + m[4] * n.y + m[5] * n.z,
            m[6] * n.x + m[7] * n.y + m[8] * n.z};
  }
};

}  // namespace octrad
