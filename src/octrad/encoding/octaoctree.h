// OctaOctree: a sparse octree whose non-empty cells hold octahedral maps of feature vectors (method sections 2-4).
// Knows points and directions only: no rays, no scenes.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "octrad/base/vec.h"

namespace octrad {

struct OctaOctreeOptions {
  int levels = 5;           // all: K and `fine`
  int features = 4;         // C
  bool trilinear = true;    // octree.interpolation
  bool barycentric = true;  // octa.interpolation
  int fine = 0;             // of these, the finest, whose cells hold one feature vector instead of a map
};

// Spatial cells per axis of level l: 2^(l+1).  Octahedral resolution: 2^(K+1-l) of levels l = 1..K; 0, one feature
// vector for all directions, of the fine levels above. `levels`: K.
constexpr int spatial_resolution(int level) { return 1 << (level + 1); }
constexpr int octahedral_resolution(int levels, int level) { return level > levels ? 0 : 1 << (levels + 1 - level); }

// Feature vectors that `cells` cells of level l need: cells (R_l + 1)^2 (paper table 2).
constexpr std::int64_t octree_entries(int levels, int level, std::int64_t cells) {
  const std::int64_t r = octahedral_resolution(levels, level) + 1;
  return cells * r * r;
}
// Those of all levels; `cells`: of each level.
constexpr std::int64_t octree_entries(int levels, std::span<const long long> cells) {
  std::int64_t entries = 0;
  for (std::size_t l = 0; l < cells.size(); ++l) entries += octree_entries(levels, static_cast<int>(l) + 1, cells[l]);
  return entries;
}

// One contribution of a query to the table: entry index (of C floats) and weight w_j b_jk.
struct Tap {
  std::uint32_t entry;
  float weight;
};

struct OctaOctreeView;  // octaoctree_math.h

class OctaOctree {
 public:
  // cells[l-1]: occupied cells of level l in Morton order. origin/size: the domain box in world units. Features are 0.
  // Throws InputError for options or cells that cannot be used, MemoryError when the table is too large.
  OctaOctree(const OctaOctreeOptions& options, const std::vector<std::vector<Vec3i>>& cells, Vec3f origin, Vec3f size);
  ~OctaOctree();
  OctaOctree(const OctaOctree&) = delete;
  OctaOctree& operator=(const OctaOctree&) = delete;

  const OctaOctreeOptions& options() const;
  Vec3f origin() const;
  Vec3f size() const;
  int feature_count() const;                   // K C
  std::int64_t entry_count() const;            // feature vectors over all levels
  std::int64_t level_offset(int level) const;  // first entry of level l
  int map_resolution(int level) const;         // R of level l, 0: one feature vector a cell
  const std::vector<Vec3i>& cells(int level) const;
  std::span<float> features();  // [entry_count][C], 64-byte aligned, huge pages where the system has them
  std::span<const float> features() const;
  // Entries on the rim of a map that name the same direction share the value of one of them; look-ups read, and taps
  // name, only that one. This copies it to the others: call it before the table is saved.
  void canonicalize_rims();
  const OctaOctreeView& view() const;  // plain pointers, valid while the octree lives

  // Features of a batch, on the calling thread. x world positions, w lookup directions (unit), d disparities in 1/world
  // units; out is feature-major [K C][stride], stride >= n: out[f * stride + i]. A point outside the
  // domain is looked up at the nearest place of the domain. Levels without an occupied cell give 0; so do points that
  // are not a number. w or d that are not finite give NaN.
  // SIMD, chosen at run time; thread-safe; a query's result does not depend on its place in the batch.
  // Returns the number of (query, level) pairs with no occupied cell.
  std::int64_t lookup(const Vec3f* x, const Vec3f* w, const float* d, int n, float* out, int stride) const;

  // Like lookup(), and records for the backward pass (overwriting it): query i's taps of level l = 1..K are
  // taps[begin[i (K+1) + l - 1]] .. taps[begin[i (K+1) + l]] (end excluded), those of weight 0 left out, and
  // derivative[f * stride + i] = d out / d disparity.
  struct Record {
    std::vector<Tap> taps;
    std::vector<std::uint32_t> begin;  // [n][K+1]
    std::vector<float> derivative;     // [K C][stride]
  };
  std::int64_t lookup_record(const Vec3f* x, const Vec3f* w, const float* d, int n, float* out, int stride,
                             Record& record) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace octrad
