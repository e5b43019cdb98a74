// The CPU fast path of the hash grid (hash_grid_math.h is its definition). Instruction set chosen at run time.
#pragma once

#include "octrad/encoding/hash_grid_math.h"
#include "octrad/encoding/octaoctree.h"

namespace octrad {

// See HashGrid::lookup. taps: null, or n x levels x 8 taps to fill.
void hash_grid_lookup(const HashGridView& view, const Vec3f* p, int n, float* out, int stride, Tap* taps);

}  // namespace octrad
