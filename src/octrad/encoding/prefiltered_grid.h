// Look-ups of a hash grid with footprints (prefiltered_grid_math.h), many at once.
#pragma once

#include <vector>

#include "octrad/encoding/octaoctree.h"
#include "octrad/encoding/prefiltered_grid_math.h"

namespace octrad {

// What training needs of look-ups.
struct PrefilteredRecord {
  std::vector<LevelBlend<float>> blends;  // [query]
  std::vector<Tap> taps;  // [query][2][8], of the blend's level and of the next; weights times those of the blend. The
                          // second eight are unused where the blend's weight is 1.
};

// p: positions in [0,1]^3 (clamped), r: footprints in the same unit. out: feature-major [features][stride]. `record`
// may be null. SIMD by way of hash_grid_lookup(), thread-safe; a query's result does not depend on those beside it.
void prefiltered_lookup(const HashGridView& grid, const Vec3f* p, const float* r, int n, float* out, int stride,
                        PrefilteredRecord* record);

}  // namespace octrad
