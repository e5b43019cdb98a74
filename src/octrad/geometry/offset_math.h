// The policy against self-intersection, the same for every tracer: rays leave surfaces from a shifted origin and start
// at 0.
#pragma once

#include <cmath>

#include "octrad/base/vec.h"

namespace octrad {

// Origin for a ray leaving `position` towards `direction`, pushed off the surface so that it does not meet it again.
// Mitsuba's rule: (1 + largest coordinate) * 1500 float epsilons along the geometric normal, to the side of
// `direction`. Surfaces closer together than that (decals, panes) are skipped as if they were one.
OCTRAD_HD inline Vec3f offset_origin(Vec3f position, Vec3f geometric_normal, Vec3f direction) {
  constexpr float kEpsilon = 1500.0f / 16777216.0f;
  const float largest = greater(std::fabs(position.x), greater(std::fabs(position.y), std::fabs(position.z)));
  const float magnitude = (1.0f + largest) * kEpsilon;
  return position + geometric_normal * std::copysign(magnitude, dot(geometric_normal, direction));
}

}  // namespace octrad
