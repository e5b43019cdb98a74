// Sine and cosine of a share of a turn, for host and device. Library functions reduce any argument with a table, for
// which kernels need local memory.
#pragma once

#include "octrad/base/vec.h"

namespace octrad {

// (cos, sin) of 2 pi u, 0 <= u <= 1, to a few 1e-7: Taylor's series within an eighth of a turn.
OCTRAD_HD inline Vec2f circle_point(float u) {
  const float turned = 4.0f * u + 0.5f;
  const int quarter = static_cast<int>(turned);  // down: it is not negative
  const float y = 0.5f * kPi * (4.0f * u - static_cast<float>(quarter)), y2 = y * y;
  const float s = y * (1.0f - y2 / 6.0f * (1.0f - y2 / 20.0f * (1.0f - y2 / 42.0f * (1.0f - y2 / 72.0f))));
  const float c = 1.0f - y2 / 2.0f * (1.0f - y2 / 12.0f * (1.0f - y2 / 30.0f * (1.0f - y2 / 56.0f)));
  switch (quarter % 4) {
    case 0: return {c, s};
    case 1: return {-s, c};
    case 2: return {-c, -s};
    default: return {s, -c};
  }
}

}  // namespace octrad
