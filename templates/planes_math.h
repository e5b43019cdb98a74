// Three planes of features (xy, yz, zx), each looked up with bilinear interpolation and added: one query, the
// definition. Template of docs/extending.md.
#pragma once

#include <cmath>
#include <cstdint>

#include "octrad/encoding/hash_grid_math.h"

namespace octrad {

inline constexpr int kPlaneTaps = 12;

// Corner c of plane a is tap 4 a + c: an entry of the table [3][resolution][resolution] and its weight. p is clamped to
// [0,1]^3, NaN to 0. resolution >= 2.
template <typename T>
OCTRAD_HD inline void plane_taps(int resolution, Vec3<T> p, std::uint32_t* entry, T* weight) {
  const auto r = static_cast<std::uint32_t>(resolution);
  for (int a = 0; a < 3; ++a) {
    std::uint32_t first[2];
    T f[2];
    for (int k = 0; k < 2; ++k) {
      const T g = clamp_unit(p[(a + k) % 3]) * static_cast<T>(resolution - 1);
      const T below = std::fmin(std::floor(g), static_cast<T>(resolution - 2));
      first[k] = static_cast<std::uint32_t>(below);
      f[k] = g - below;
    }
    for (int c = 0; c < 4; ++c) {
      const int u = c & 1, v = c >> 1;
      entry[4 * a + c] = (static_cast<std::uint32_t>(a) * r + first[1] + static_cast<std::uint32_t>(v)) * r + first[0] +
                         static_cast<std::uint32_t>(u);
      weight[4 * a + c] = (u != 0 ? f[0] : T(1) - f[0]) * (v != 0 ? f[1] : T(1) - f[1]);
    }
  }
}

}  // namespace octrad
