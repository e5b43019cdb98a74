// The OctaOctree query and its derivative by the disparity: the definition (method section 4), for one query. A scalar loop
// over it is the reference for the SIMD path and for kernels. Host and device: no heap, no containers, no exceptions.
#pragma once

#include <cmath>
#include <cstdint>

#include "base/vec.h"
#include "encoding/cell_index.h"
#include "encoding/octahedral_math.h"

namespace octrad {

inline constexpr int kMaxOctreeLevels = 9;
inline constexpr int kMaxOctreeFeatures = 8;

struct OctreeLevelView {
  CellIndexView index;
  int spatial_resolution = 0;               // cells per axis
  int octahedral_resolution = 0;            // R
  std::uint32_t first_entry = 0;            // of the table
  Vec3f cell_size;                          // e_l, world units per axis
};

// Plain pointers into an OctaOctree: what the fast paths and kernels are given.
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
  int count = 0;                            // 0: nothing here
  std::uint32_t cell[8];                    // numbers within the level
  T weight[8];                              // 0: this corner does not count
  Vec3<T> low, high;                        // x - c_j of the corners 0 and 7

  OCTRAD_HD Vec3<T> offset(int corner) const {
    return {corner & 1 ? high.x : low.x, corner >> 1 & 1 ? high.y : low.y, corner >> 2 & 1 ? high.z : low.z};
  }
};

// p: position normalised to the domain. Cells count that lie inside the grid, are occupied and have a trilinear weight
// above 0 (a weight of exactly 0 is skipped before emptiness is looked at).
template <typename T>
OCTRAD_HD inline CellStencil<T> cell_stencil(const OctreeLevelView& level, Vec3<T> p, bool trilinear) {
  CellStencil<T> r;
  OCTRAD_UNROLL
  for (int corner = 0; corner < 8; ++corner) r.weight[corner] = T(0);
  const T resolution = static_cast<T>(level.spatial_resolution);
  const Vec3<T> g = p * resolution - Vec3<T>(T(0.5));
  // Outside by a cell or more, or not a number: no corner lies in the grid.
  if (!(g.x >= T(-1) && g.x <= resolution && g.y >= T(-1) && g.y <= resolution && g.z >= T(-1) && g.z <= resolution)) return r;
  const Vec3<T> base{std::floor(g.x), std::floor(g.y), std::floor(g.z)};
  const Vec3<T> f = g - base;
  const Vec3<T> edge(level.cell_size);
  r.low = f * edge;                         // exact to rounding of f, no cancellation
  r.high = (f - Vec3<T>(T(1))) * edge;
  const int x = static_cast<int>(base.x), y = static_cast<int>(base.y), z = static_cast<int>(base.z);
  T sum = T(0);
  OCTRAD_UNROLL
  for (int corner = 0; corner < 8; ++corner) {
    const int o[3] = {corner & 1, corner >> 1 & 1, corner >> 2 & 1};
    T weight = T(1);
    OCTRAD_UNROLL
    for (int a = 0; a < 3; ++a) {
      const T high = trilinear ? f[a] : (f[a] >= T(0.5) ? T(1) : T(0));
      weight *= o[a] ? high : T(1) - high;
    }
    if (!(weight > T(0))) continue;
    const std::int64_t cell = level.index.find(x + o[0], y + o[1], z + o[2]);
    if (cell < 0) continue;
    r.cell[corner] = static_cast<std::uint32_t>(cell);
    r.weight[corner] = weight;
    ++r.count;
    sum += weight;
  }
  OCTRAD_UNROLL
  for (int corner = 0; corner < 8; ++corner) {
    if (r.weight[corner] > T(0)) r.weight[corner] /= sum;
  }
  return r;
}

// Calls visit(entry, weight, dweight) for every tap of the query at this level: table entry, w_j b_jk and its derivative by
// the disparity d. w: look-up direction. Returns the number of cells that counted.
template <typename T, typename Visitor>
OCTRAD_HD inline int visit_level(const OctaOctreeView& view, const OctreeLevelView& level, Vec3<T> p, Vec3<T> w, T d, Visitor&& visit) {
  const CellStencil<T> stencil = cell_stencil(level, p, view.trilinear);
  const int resolution = level.octahedral_resolution;
  const std::uint32_t map_size = static_cast<std::uint32_t>((resolution + 1) * (resolution + 1));
  OCTRAD_UNROLL
  for (int j = 0; j < 8; ++j) {
    if (!(stencil.weight[j] > T(0))) continue;
    const std::uint32_t map = level.first_entry + stencil.cell[j] * map_size;
    const Vec3<T> offset = stencil.offset(j);
    const Vec3<T> v = offset * d + w;                        // parallax: the direction seen from the cell's centre
    const OctaProjection<T> projection = octa_project(v);
    if (!view.barycentric) {
      const OctaVertex a = octa_nearest(projection.u, resolution);
      visit(map + static_cast<std::uint32_t>(octa_vertex_index(a.i, a.j, resolution)), stencil.weight[j], T(0));
      continue;
    }
    const OctaTriangle<T> triangle = octa_triangle(projection.u, resolution);
    const Vec2<T> velocity = octa_velocity(projection, v, offset) * static_cast<T>(resolution / 2);
    OCTRAD_UNROLL
    for (int k = 0; k < 3; ++k) {
      const OctaVertex a = triangle.vertex[k];
      visit(map + static_cast<std::uint32_t>(octa_vertex_index(a.i, a.j, resolution)), stencil.weight[j] * triangle.weight[k],
            stencil.weight[j] * (triangle.by_x[k] * velocity.x + triangle.by_y[k] * velocity.y));
    }
  }
  return stencil.count;
}

// Position normalised to the domain.
template <typename T>
OCTRAD_HD inline Vec3<T> normalize_position(const OctaOctreeView& view, Vec3<T> x) {
  return (x - Vec3<T>(view.origin)) / Vec3<T>(view.size);
}

// All features of one query and, unless null, their derivatives by the disparity: [K C] each. Returns the number of levels
// without an occupied cell (their features are 0).
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
