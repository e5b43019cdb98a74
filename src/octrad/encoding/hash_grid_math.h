// Multi-resolution hash grid, one query and level: the definition (method section 5; Mueller et al. 2022, "Instant
// Neural Graphics Primitives"). The fast path and kernels are tested against it.
#pragma once

#include <cmath>
#include <cstdint>

#include "octrad/base/vec.h"

namespace octrad {

inline constexpr int kMaxHashGridLevels = 16;

struct HashGridLevelView {
  float scale = 0.0f;            // base growth^l - 1
  std::uint32_t resolution = 0;  // r = ceil(scale) + 1
  std::uint32_t first_entry = 0;
  std::uint32_t entries = 0;  // r^3 where that fits the table, else the table's size
  bool dense = true;
};

struct HashGridView {
  const float* table = nullptr;  // [entries][features]
  int levels = 0;
  int features = 0;  // F
  HashGridLevelView level[kMaxHashGridLevels];
};

// NaN becomes 0.
template <typename T>
OCTRAD_HD constexpr T clamp_unit(T a) {
  return a > T(0) ? (a < T(1) ? a : T(1)) : T(0);
}

// Corner c = 0 .. 7 (bit a: upper side of axis a): entry of the whole table and trilinear weight. p is clamped to
// [0,1]^3.
template <typename T>
OCTRAD_HD inline void hash_grid_taps(const HashGridLevelView& level, Vec3<T> p, std::uint32_t* entry, T* weight) {
  // Steps of the entry from vertex to vertex along each axis.
  const std::uint32_t r = level.resolution,
                      step[3] = {1u, level.dense ? r : 2654435761u, level.dense ? r * r : 805459861u};
  std::uint32_t part[3][2];
  T f[3];
  OCTRAD_UNROLL
  for (int a = 0; a < 3; ++a) {
    const T g = clamp_unit(p[a]) * static_cast<T>(level.scale) + T(0.5);
    const T i = std::floor(g);
    part[a][0] = static_cast<std::uint32_t>(i) * step[a];
    part[a][1] = part[a][0] + step[a];
    f[a] = g - i;
  }
  // A coordinate may be r itself (position 1 lies half a cell inside the last vertex's cell); in a dense level such a
  // vertex wraps modulo the level's entries, as in the original.
  if (level.dense) {
    OCTRAD_UNROLL
    for (int c = 0; c < 8; ++c) {
      const std::uint32_t index = part[0][c & 1] + part[1][c >> 1 & 1] + part[2][c >> 2 & 1];
      entry[c] = level.first_entry + (index >= level.entries ? index - level.entries : index);  // index < 2 entries
    }
  } else {
    OCTRAD_UNROLL
    for (int c = 0; c < 8; ++c) {
      entry[c] =
          level.first_entry + ((part[0][c & 1] ^ part[1][c >> 1 & 1] ^ part[2][c >> 2 & 1]) & (level.entries - 1));
    }
  }
  OCTRAD_UNROLL
  for (int c = 0; c < 8; ++c) {
    T w = T(1);
    OCTRAD_UNROLL
    for (int a = 0; a < 3; ++a) w *= (c >> a & 1) != 0 ? f[a] : T(1) - f[a];
    weight[c] = w;
  }
}

}  // namespace octrad
