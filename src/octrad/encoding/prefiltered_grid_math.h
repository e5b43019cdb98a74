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

}  // namespace octrad
