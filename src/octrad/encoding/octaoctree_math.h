// The OctaOctree query and its derivative by the disparity: the definition (method section 4, paper equations 8 to 11),
// for one query. A scalar loop over it is the reference for the SIMD path and for kernels. Host and device: no heap, no
// containers, no exceptions.
#pragma once

#include <cmath>
#include <cstdint>

#include "octrad/base/vec.h"
#include "octrad/encoding/cell_index.h"
#include "octrad/encoding/octahedral_math.h"

namespace octrad {

inline constexpr int kMaxOctreeLevels = 9;
inline constexpr int kMaxOctreeFeatures = 8;

struct OctreeLevelView {
  CellIndexView index;
  int spatial_resolution = 0;     // cells per axis
  int octahedral_resolution = 0;  // R
  OctaMap<float> map;             // octa_map(R)
  std::uint32_t first_entry = 0;  // of the table
  Vec3f cell_size;                // e_l, world units per axis
};

// Plain pointers into an OctaOctree, for the fast paths and kernels.
struct OctaOctreeView {
  const float* table = nullptr;             // [entries][features]
  int levels = 0;                           // K
  int features = 0;                         // C
  bool trilinear = true;                    // false: the one cell whose centre is nearest
  bool barycentric = true;                  // false: the one nearest vertex
  Vec3f origin, size;                       // domain, world units
  OctreeLevelView level[kMaxOctreeLevels];  // l = 1 .. K at [l - 1]
};

// The occupied cells around a point: renormalised weights w_j and offsets x - c_j (world units).
template <typename T>
struct CellStencil {
  int count = 0;          // 0: nothing here
  std::uint32_t cell[8];  // numbers within the level
  T weight[8];            // 0: this corner does not count
  Vec3<T> low, high;      // x - c_j of the corners 0 and 7

  OCTRAD_HD Vec3<T> offset(int corner) const {
    return {corner & 1 ? high.x : low.x, corner >> 1 & 1 ? high.y : low.y, corner >> 2 & 1 ? high.z : low.z};
  }
};

// One axis of the stencil, lower and upper cell.
template <typename T>
struct StencilAxis {
  T weight[2];         // 0 outside the grid
  T offset[2];         // x - c_j, world units
  CellPlace place[2];  // of the cell in the grid that is nearest to it
};

// p: position normalised to the domain.
template <typename T>
OCTRAD_HD inline StencilAxis<T> stencil_axis(const OctreeLevelView& level, int axis, T p, bool trilinear) {
  const T resolution = static_cast<T>(level.spatial_resolution), g = p * resolution - T(0.5);
  // A position that is outside by a cell or more, or NaN, is moved to two cells below the grid.
  const bool near = g >= T(-1) && g <= resolution;
  const T base = near ? std::floor(g) : T(-2), f = near ? g - base : T(0);
  const T high = trilinear ? f : (f >= T(0.5) ? T(1) : T(0));
  const T edge = static_cast<T>(level.cell_size[axis]);
  StencilAxis<T> r;
  r.weight[0] = base >= T(0) && base < resolution ? T(1) - high : T(0);
  r.weight[1] = base >= T(-1) && base < resolution - T(1) ? high : T(0);
  r.offset[0] = f * edge;  // exact to rounding of f, no cancellation
  r.offset[1] = (f - T(1)) * edge;
  const int last = level.spatial_resolution - 1, lower = static_cast<int>(base), upper = lower + 1;
  r.place[0] = level.index.place(axis, lower < 0 ? 0 : (lower > last ? last : lower));
  r.place[1] = level.index.place(axis, upper < 0 ? 0 : (upper > last ? last : upper));
  return r;
}

// Cells count that lie inside the grid, are occupied and have a trilinear weight above 0. All are looked up, whatever
// their weight: eight loads that wait for nothing are faster than branches.
template <typename T>
OCTRAD_HD inline CellStencil<T> cell_stencil(const OctreeLevelView& level, Vec3<T> p, bool trilinear) {
  const StencilAxis<T> x = stencil_axis(level, 0, p.x, trilinear), y = stencil_axis(level, 1, p.y, trilinear),
                       z = stencil_axis(level, 2, p.z, trilinear);
  CellStencil<T> r;
  r.low = {x.offset[0], y.offset[0], z.offset[0]};
  r.high = {x.offset[1], y.offset[1], z.offset[1]};
  T sum = T(0);
  OCTRAD_UNROLL
  for (int corner = 0; corner < 8; ++corner) {
    const int i = corner & 1, j = corner >> 1 & 1, k = corner >> 2 & 1;
    r.cell[corner] = level.index.number(x.place[i] + y.place[j] + z.place[k]);
    const T weight = x.weight[i] * y.weight[j] * z.weight[k];
    r.weight[corner] = r.cell[corner] != kNoCell ? weight : T(0);
    r.count += r.weight[corner] > T(0) ? 1 : 0;
    sum += r.weight[corner];
  }
  const T normalize = sum > T(0) ? reciprocal(sum) : T(0);
  OCTRAD_UNROLL
  for (int corner = 0; corner < 8; ++corner) r.weight[corner] *= normalize;
  return r;
}

// Calls visit(entry, weight, dweight) for every tap of the query at this level: table entry, w_j b_jk and its
// derivative by the disparity d. w: look-up direction. Returns the number of cells that counted.
template <typename T, typename Visitor>
OCTRAD_HD inline int visit_level(const OctaOctreeView& view, const OctreeLevelView& level, Vec3<T> p, Vec3<T> w, T d,
                                 Visitor&& visit) {
  const CellStencil<T> stencil = cell_stencil(level, p, view.trilinear);
  const std::uint32_t map_size =
      static_cast<std::uint32_t>((level.octahedral_resolution + 1) * (level.octahedral_resolution + 1));
  OctaMap<T> octa;
  if constexpr (std::is_same_v<T, float>) octa = level.map;
  else octa = octa_map<T>(level.octahedral_resolution);
  OCTRAD_UNROLL
  for (int j = 0; j < 8; ++j) {
    if (!(stencil.weight[j] > T(0))) continue;
    const std::uint32_t map = level.first_entry + stencil.cell[j] * map_size;
    if (level.octahedral_resolution == 0) {
      visit(map, stencil.weight[j], T(0));
      continue;
    }
    const Vec3<T> offset = stencil.offset(j);
    const Vec3<T> v = offset * d + w;  // parallax: the direction seen from the cell's centre
    const OctaProjection<T> projection = octa_project(v);
    if (!view.barycentric) {
      visit(map + octa_vertex_index(octa_nearest(projection.u, octa), octa), stencil.weight[j], T(0));
      continue;
    }
    const OctaTriangle<T> triangle = octa_triangle(projection.u, octa);
    T slope[3];
    triangle.slopes(octa_velocity(projection, v, offset) * octa.half, slope);
    OCTRAD_UNROLL
    for (int k = 0; k < 3; ++k) {
      visit(map + octa_vertex_index(triangle.vertex[k], octa), stencil.weight[j] * triangle.weight[k],
            stencil.weight[j] * slope[k]);
    }
  }
  return stencil.count;
}

// Position normalised to the domain; a position outside is moved to the nearest one of the domain, a NaN stays one.
template <typename T>
OCTRAD_HD inline Vec3<T> normalize_position(const OctaOctreeView& view, Vec3<T> x) {
  Vec3<T> p = divide(x - Vec3<T>(view.origin), Vec3<T>(view.size));
  for (int a = 0; a < 3; ++a) p[a] = p[a] < T(0) ? T(0) : (p[a] > T(1) ? T(1) : p[a]);
  return p;
}

// All features of one query and, unless null, their derivatives by the disparity: [K C] each. Returns the number of
// levels without an occupied cell (their features are 0).
template <typename T>
OCTRAD_HD inline int lookup_query(const OctaOctreeView& view, Vec3<T> x, Vec3<T> w, T d, T* features, T* derivative) {
  const Vec3<T> p = normalize_position(view, x);
  int empty = 0;
  for (int l = 0; l < view.levels; ++l) {
    T value[kMaxOctreeFeatures] = {}, slope[kMaxOctreeFeatures] = {};
    const int count = visit_level(view, view.level[l], p, w, d, [&](std::uint32_t entry, T weight, T dweight) {
      const float* t = view.table + static_cast<std::uint64_t>(entry) * static_cast<std::uint64_t>(view.features);
      for (int c = 0; c < view.features; ++c) {
        value[c] += weight * static_cast<T>(t[c]);
        slope[c] += dweight * static_cast<T>(t[c]);
      }
    });
    if (count == 0) ++empty;
    for (int c = 0; c < view.features; ++c) {
      features[l * view.features + c] = value[c];
      if (derivative != nullptr) derivative[l * view.features + c] = slope[c];
    }
  }
  return empty;
}

}  // namespace octrad
