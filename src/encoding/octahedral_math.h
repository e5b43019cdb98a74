// Octahedral map of directions and barycentric interpolation on it (method section 2; the map: Praun and Hoppe 2003,
// "Spherical Parametrization and Remeshing"). The definition: the SIMD path and kernels are tested against it.
//
// A direction (x, y, z) goes to u = (x, y) / (|x| + |y| + |z|), the lower half folded outwards, u in [-1, 1]^2. A map of
// resolution R (even) stores (R + 1)^2 vertices at integer (i, j), i, j in [-h, h], h = R / 2, of the scaled square h u.
// The diagonals of the cells run parallel to the octahedron edge |u| + |v| = 1 of their quadrant, so no triangle
// straddles two faces. Rim vertices come in pairs that are one direction; vertices are always returned in canonical
// form (the non-negative one of the pair; all four corners are (h, h)).
#pragma once

#include <cmath>

#include "base/vec.h"

namespace octrad {

// Below this L1 norm a vector has no direction; it is treated as +z.
inline constexpr float kMinL1Norm = 1e-37f;

// Projection of a direction of any length, with what its derivative needs.
template <typename T>
struct OctaProjection {
  Vec2<T> u;             // in [-1, 1]^2
  Vec3<T> p;             // v / |v|_1
  T inverse_norm;        // 1 / |v|_1
  bool folded;           // lower half: v.z < 0
};

template <typename T> OCTRAD_HD constexpr T octa_sign(T a) { return a < T(0) ? T(-1) : T(1); }  // sign(0) = +1 always

template <typename T>
OCTRAD_HD inline OctaProjection<T> octa_project(Vec3<T> v) {
  T norm = std::abs(v.x) + std::abs(v.y) + std::abs(v.z);
  norm = norm > T(kMinL1Norm) ? norm : T(kMinL1Norm);
  OctaProjection<T> r;
  r.inverse_norm = T(1) / norm;
  r.p = v * r.inverse_norm;
  r.folded = v.z < T(0);
  r.u = {r.p.x, r.p.y};
  if (r.folded) {
    r.u = {(T(1) - std::abs(r.p.y)) * octa_sign(r.p.x), (T(1) - std::abs(r.p.x)) * octa_sign(r.p.y)};
  }
  return r;
}

// Direction (unit length) of a point of the square; the inverse of octa_project.
template <typename T>
OCTRAD_HD inline Vec3<T> octa_unproject(Vec2<T> u) {
  Vec3<T> v{u.x, u.y, T(1) - std::abs(u.x) - std::abs(u.y)};
  if (v.z < T(0)) {
    v.x = (T(1) - std::abs(u.y)) * octa_sign(u.x);
    v.y = (T(1) - std::abs(u.x)) * octa_sign(u.y);
  }
  return normalize(v);
}

// du/dt when the projected vector moves with velocity `delta` (v = v0 + t delta), away from the edges of the octahedron.
template <typename T>
OCTRAD_HD inline Vec2<T> octa_velocity(const OctaProjection<T>& r, Vec3<T> v, Vec3<T> delta) {
  const T norm_velocity = octa_sign(v.x) * delta.x + octa_sign(v.y) * delta.y + octa_sign(v.z) * delta.z;
  const T px = (delta.x - r.p.x * norm_velocity) * r.inverse_norm;
  const T py = (delta.y - r.p.y * norm_velocity) * r.inverse_norm;
  if (!r.folded) return {px, py};
  const T sign = -octa_sign(v.x) * octa_sign(v.y);
  return {sign * py, sign * px};
}

// Row-major index of vertex (i, j), i, j in [-R/2, R/2]: i runs along u_x.
OCTRAD_HD constexpr int octa_vertex_index(int i, int j, int resolution) {
  return (j + resolution / 2) * (resolution + 1) + i + resolution / 2;
}

struct OctaVertex { int i, j; };

// The stored one of the rim vertices that are the same direction.
OCTRAD_HD constexpr OctaVertex octa_canonical(OctaVertex a, int resolution) {
  const int h = resolution / 2;
  const bool rim_i = a.i == h || a.i == -h, rim_j = a.j == h || a.j == -h;
  return {rim_j && a.i < 0 ? -a.i : a.i, rim_i && a.j < 0 ? -a.j : a.j};
}

// Three vertices, their weights (>= 0, sum 1) and the weights' constant derivatives by the scaled coordinates (h u).
template <typename T>
struct OctaTriangle {
  OctaVertex vertex[3];   // canonical
  T weight[3];
  T by_x[3], by_y[3];
};

// Lower corner of the cell that holds coordinate `a` of the scaled square; NaN goes to the first cell.
template <typename T>
OCTRAD_HD inline int octa_cell(T a, int half) {
  const T f = std::floor(a);
  if (!(f >= T(-half))) return -half;
  return f > T(half - 1) ? half - 1 : static_cast<int>(f);
}

template <typename T>
OCTRAD_HD inline OctaTriangle<T> octa_triangle(Vec2<T> u, int resolution) {
  const int half = resolution / 2;
  const T h = static_cast<T>(half);
  T x = u.x * h, y = u.y * h;
  x = x > h ? h : (x < -h ? -h : x);
  y = y > h ? h : (y < -h ? -h : y);
  const int i = octa_cell(x, half), j = octa_cell(y, half);
  const T s = x - static_cast<T>(i), t = y - static_cast<T>(j);
  OctaTriangle<T> r;
  OctaVertex a, b, c;
  if ((i < 0) != (j < 0)) {           // quadrants 2 and 4: diagonal (i, j) - (i+1, j+1)
    a = {i, j};
    b = {i + 1, j + 1};
    if (s > t) {
      c = {i + 1, j};
      r = {{}, {T(1) - s, t, s - t}, {T(-1), T(0), T(1)}, {T(0), T(1), T(-1)}};
    } else {
      c = {i, j + 1};
      r = {{}, {T(1) - t, s, t - s}, {T(0), T(1), T(-1)}, {T(-1), T(0), T(1)}};
    }
  } else {                            // quadrants 1 and 3: diagonal (i+1, j) - (i, j+1)
    a = {i + 1, j};
    b = {i, j + 1};
    if (s + t > T(1)) {
      c = {i + 1, j + 1};
      r = {{}, {T(1) - t, T(1) - s, s + t - T(1)}, {T(0), T(-1), T(1)}, {T(-1), T(0), T(1)}};
    } else {
      c = {i, j};
      r = {{}, {s, t, T(1) - (s + t)}, {T(1), T(0), T(-1)}, {T(0), T(1), T(-1)}};
    }
  }
  r.vertex[0] = octa_canonical(a, resolution);
  r.vertex[1] = octa_canonical(b, resolution);
  r.vertex[2] = octa_canonical(c, resolution);
  return r;
}

// The stored vertex nearest to u on the square (octa.interpolation = nearest).
template <typename T>
OCTRAD_HD inline OctaVertex octa_nearest(Vec2<T> u, int resolution) {
  const int half = resolution / 2;
  const T h = static_cast<T>(half);
  const int i = octa_cell(u.x * h, half), j = octa_cell(u.y * h, half);
  const OctaVertex a{i + (u.x * h - static_cast<T>(i) >= T(0.5) ? 1 : 0), j + (u.y * h - static_cast<T>(j) >= T(0.5) ? 1 : 0)};
  return octa_canonical(a, resolution);
}

}  // namespace octrad
