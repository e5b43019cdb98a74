// A primary ray. Plain data, for host and device.
#pragma once

#include "octrad/base/vec.h"

namespace octrad {

struct Ray {
  Vec3f origin, direction;  // direction has unit length
  float t_max = 1e30f;      // far clipping plane; hits beyond it do not count
};

}  // namespace octrad
