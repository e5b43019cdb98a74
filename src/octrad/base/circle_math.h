// Sine and cosine of a share of a turn, for host and device. Library functions reduce any argument with a table, for
// which kernels need local memory.
#pragma once

#include "octrad/base/bits.h"
#include "octrad/base/vec.h"

namespace octrad {

// (cos, sin) of an angle of at most an eighth of a turn, in radians, to 1e-7: Taylor's series.
OCTRAD_HD inline Vec2f arc_point(float angle) {
  const float x = angle * angle;
  const float c = 1.0f - x * (1.0f / 2.0f - x * (1.0f / 24.0f - x * (1.0f / 720.0f - x * (1.0f / 40320.0f))));
  const float s = 1.0f - x * (1.0f / 6.0f - x * (1.0f / 120.0f - x * (1.0f / 5040.0f - x * (1.0f / 362880.0f))));
  return {c, angle * s};
}

// (cos, sin) of 2 pi u, u >= 0, to a few 1e-7.
OCTRAD_HD inline Vec2f circle_point(float u) {
  const float turned = 4.0f * u + 0.5f;
  const int quarter = static_cast<int>(turned);  // down: it is not negative
  const Vec2f p = arc_point(0.5f * kPi * (4.0f * u - static_cast<float>(quarter)));
  const bool odd = (quarter & 1) != 0;
  const auto sign = [](int bit) { return static_cast<std::uint32_t>(bit & 2) << 30; };
  return {float_of(bits_of(choose(odd, p.y, p.x)) ^ sign(quarter + 1)),
          float_of(bits_of(choose(odd, p.x, p.y)) ^ sign(quarter))};
}

}  // namespace octrad
