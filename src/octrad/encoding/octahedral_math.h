// Octahedral map of directions and barycentric interpolation on it (method section 2, paper equations 4 to 6; the map:
// Praun and Hoppe 2003, "Spherical Parametrization and Remeshing"). The definition: the SIMD path and kernels are
// tested against it.
//
// A direction (x, y, z) goes to u = (x, y) / (|x| + |y| + |z|), the lower half folded outwards, u in [-1, 1]^2. A map
// of resolution R (even) stores (R + 1)^2 vertices at integer (i, j), i, j in [-h, h], h = R / 2, of the scaled square
// h u. The diagonals of the cells run parallel to the octahedron edge |u| + |v| = 1 of their quadrant, so no triangle
// straddles two faces. Rim vertices come in pairs that are one direction; vertices are always returned in canonical
// form (the non-negative one of the pair; all four corners are (h, h)).
#pragma once

#include <cmath>
#include <cstdint>
#include <type_traits>

#include "octrad/base/bits.h"
#include "octrad/base/vec.h"

namespace octrad {

// Vectors of a smaller L1 norm have no direction and are treated as +z, or as -z for z < 0.
inline constexpr float kMinL1Norm = 1e-37f;

// Projection of a direction of any length, with what its derivative needs.
template <typename T>
struct OctaProjection {
  Vec2<T> u;       // in [-1, 1]^2
  Vec3<T> p;       // v / |v|_1
  T inverse_norm;  // 1 / |v|_1
  bool folded;     // lower half: v.z < 0
};

template <typename T>
OCTRAD_HD constexpr T octa_sign(T a) {
  return a < T(0) ? T(-1) : T(1);
}  // sign(0) = +1 always

template <typename T>
OCTRAD_HD inline OctaProjection<T> octa_project(Vec3<T> v) {
  T norm = std::abs(v.x) + std::abs(v.y) + std::abs(v.z);
  norm = greater(norm, T(kMinL1Norm));
  OctaProjection<T> r;
  r.inverse_norm = reciprocal(norm);
  r.p = v * r.inverse_norm;
  r.folded = v.z < T(0);
  r.u = {r.p.x, r.p.y};
  if (r.folded) {
    r.u = {(T(1) - std::abs(r.p.y)) * octa_sign(r.p.x), (T(1) - std::abs(r.p.x)) * octa_sign(r.p.y)};
  }
  return r;
}

// du/dt when the projected vector moves with velocity `delta` (v = v0 + t delta), away from the edges of the
// octahedron.
template <typename T>
OCTRAD_HD inline Vec2<T> octa_velocity(const OctaProjection<T>& r, Vec3<T> v, Vec3<T> delta) {
  const T norm_velocity = octa_sign(v.x) * delta.x + octa_sign(v.y) * delta.y + octa_sign(v.z) * delta.z;
  const T px = (delta.x - r.p.x * norm_velocity) * r.inverse_norm;
  const T py = (delta.y - r.p.y * norm_velocity) * r.inverse_norm;
  if (!r.folded) return {px, py};
  const T sign = -octa_sign(v.x) * octa_sign(v.y);
  return {sign * py, sign * px};
}

// Column and row of a vertex, in [-R/2, R/2]: whole numbers, kept in T so that inner loops convert nothing.
template <typename T>
struct OctaVertex {
  T i, j;
};

// Constants of a map of resolution R, for inner loops.
template <typename T>
struct OctaMap {
  T half;    // h = R / 2
  T row;     // vertices of a row
  T center;  // index of vertex (0, 0); for floats on top of 2^23 (see below)
};
template <typename T>
OCTRAD_HD inline OctaMap<T> octa_map(int resolution) {
  return {static_cast<T>(resolution / 2), static_cast<T>(resolution + 1),
          static_cast<T>(resolution / 2 * (resolution + 2)) + (std::is_same_v<T, float> ? T(8388608) : T(0))};
}

// Row-major index of a vertex: i runs along u_x. For floats it is computed in floats on top of 2^23, whose bits are
// then an integer (maps have fewer than 2^23 vertices): conversions are slow on GPUs.
template <typename T>
OCTRAD_HD inline std::uint32_t octa_vertex_index(OctaVertex<T> a, const OctaMap<T>& map) {
  const T index = a.j * map.row + (a.i + map.center);
  if constexpr (std::is_same_v<T, float>) {
    return bits_of(index) - 0x4b000000u;
  } else {
    return static_cast<std::uint32_t>(index);
  }
}

// The canonical one of the rim vertices that are the same direction: on a rim row the column is made positive, on a rim
// column the row.
template <typename T>
OCTRAD_HD inline OctaVertex<T> octa_canonical(OctaVertex<T> a, T half) {
  return {std::abs(a.j) == half ? std::abs(a.i) : a.i, std::abs(a.i) == half ? std::abs(a.j) : a.j};
}

// Three vertices and their weights (>= 0, sum 1).
template <typename T>
struct OctaTriangle {
  OctaVertex<T> vertex[3];  // canonical
  T weight[3];
  bool mirrored, right;

  // How the weights change when the point of the scaled square (h u) moves with this velocity.
  OCTRAD_HD void slopes(Vec2<T> velocity, T (&slope)[3]) const {
    const T m = mirrored ? -velocity.x : velocity.x, t = velocity.y;
    const T upper = right ? m : t, lower = right ? t : m;
    slope[0] = -upper;
    slope[1] = lower;
    slope[2] = upper - lower;
  }
};

// A coordinate of the scaled square in [-h, h], and the lower corner of the cell that holds it; NaN goes to the first
// cell.
template <typename T>
OCTRAD_HD inline T octa_coordinate(T a, T half) {
  return lesser(greater(a * half, -half), half);
}
template <typename T>
OCTRAD_HD inline T octa_cell(T a, T half) {
  return lesser(std::floor(a), half - T(1));
}

// In quadrants 2 and 4 a cell's diagonal runs from (i, j) to (i+1, j+1); cells of quadrants 1 and 3 are those mirrored
// in x: m in place of the distance s from the cell's left side, and the columns a and b swapped.
template <typename T>
OCTRAD_HD inline OctaTriangle<T> octa_triangle(Vec2<T> u, const OctaMap<T>& map) {
  const T half = map.half;
  const T x = octa_coordinate(u.x, half), y = octa_coordinate(u.y, half);
  const T i = octa_cell(x, half), j = octa_cell(y, half);
  const T s = x - i, t = y - j;
  OctaTriangle<T> r;
  r.mirrored = (i < T(0)) == (j < T(0));
  const T m = r.mirrored ? T(1) - s : s;
  const T a = r.mirrored ? i + T(1) : i, b = r.mirrored ? i : i + T(1);
  r.right = m > t;
  const T upper = r.right ? m : t, lower = r.right ? t : m;
  r.weight[0] = T(1) - upper;
  r.weight[1] = lower;
  r.weight[2] = upper - lower;
  r.vertex[0] = octa_canonical<T>({a, j}, half);
  r.vertex[1] = octa_canonical<T>({b, j + T(1)}, half);
  r.vertex[2] = octa_canonical<T>({r.right ? b : a, r.right ? j : j + T(1)}, half);
  return r;
}

// The stored vertex nearest to u on the square (octa.interpolation = nearest).
template <typename T>
OCTRAD_HD inline OctaVertex<T> octa_nearest(Vec2<T> u, const OctaMap<T>& map) {
  const T half = map.half;
  const T x = octa_coordinate(u.x, half), y = octa_coordinate(u.y, half);
  const T i = octa_cell(x, half), j = octa_cell(y, half);
  return octa_canonical<T>({x - i >= T(0.5) ? i + T(1) : i, y - j >= T(0.5) ? j + T(1) : j}, half);
}

}  // namespace octrad
