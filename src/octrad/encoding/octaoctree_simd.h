// The CPU fast path of the OctaOctree query (octaoctree_math.h is its definition). Instruction set chosen at run time.
#pragma once

#include <cstdint>

#include "octrad/encoding/octaoctree.h"
#include "octrad/encoding/octaoctree_math.h"

namespace octrad {

// See OctaOctree::lookup and OctaOctree::lookup_record.
std::int64_t octaoctree_lookup(const OctaOctreeView& view, const Vec3f* x, const Vec3f* w, const float* d, int n,
                               float* out, int stride);
std::int64_t octaoctree_lookup_record(const OctaOctreeView& view, const Vec3f* x, const Vec3f* w, const float* d, int n,
                                      float* out, int stride, OctaOctree::Record& record);

}  // namespace octrad
