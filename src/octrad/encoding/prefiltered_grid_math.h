// A hash grid looked up with a footprint: one feature vector, blended between the two levels whose cells are about as
// large (Ren et al. 2025, "Neural Cone Radiosity"; method section 9). The definition, for host and device.
#pragma once

#include "octrad/encoding/hash_grid_math.h"

namespace octrad {

// Level `level` with `weight`, and where that is below 1 the next finer one with 1 - weight.
template <typename T>
struct LevelBlend {
  int level;
  T weight;
};

// The footprint that level l stands for, in units of the grid's box: 2 / its resolution.
template <typename T>
OCTRAD_HD inline T level_footprint(const HashGridLevelView& level) {
  return T(2) / (static_cast<T>(level.scale) + T(1));
}

// Linear in `r` between the footprints of neighbouring levels; the coarsest level above all, the finest below. Its
// derivative by r is 1 / (difference of the two footprints), or 0. NaN takes the finest level.
template <typename T>
OCTRAD_HD inline LevelBlend<T> blend_levels(const HashGridView& grid, T r) {
  T coarse = level_footprint<T>(grid.level[0]);
  if (r >= coarse) return {0, T(1)};
  for (int l = 0; l + 1 < grid.levels; ++l) {
    const T fine = level_footprint<T>(grid.level[l + 1]);
    if (r >= fine) return {l, (r - fine) / (coarse - fine)};
    coarse = fine;
  }
  return {grid.levels - 1, T(1)};
}

// visit(side, entry, weight, of_level) for the blend's level (side 0) and, where it has any weight, the next one (side
// 1): taps of a hash grid's level as hash_grid_taps() gives them, and the level's own weight. p in [0,1]^3 (clamped).
OCTRAD_HD_OR_HOST
template <typename T, typename Visitor>
OCTRAD_HD inline void visit_prefiltered(const HashGridView& grid, Vec3<T> p, T r, Visitor&& visit) {
  const LevelBlend<T> blend = blend_levels(grid, r);
  const int sides = blend.weight < T(1) ? 2 : 1;
  for (int side = 0; side < sides; ++side) {  // a loop, so that kernels contain the look-up once
    std::uint32_t entry[8];
    T weight[8];
    hash_grid_taps(grid.level[blend.level + side], p, entry, weight);
    visit(side, entry, weight, side == 0 ? blend.weight : T(1) - blend.weight);
  }
}

}  // namespace octrad
