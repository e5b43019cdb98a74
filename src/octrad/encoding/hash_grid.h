// Multi-resolution hash grid (Mueller et al. 2022; method section 5): linear interpolation, dense while it fits.
// hash_grid_math.h has the formulas.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "octrad/base/vec.h"
#include "octrad/encoding/hash_grid_math.h"
#include "octrad/encoding/huge_array.h"
#include "octrad/encoding/octaoctree.h"

namespace octrad {

struct HashGridOptions {
  int levels = 6;
  int features = 2;  // F: 2, 4 or 8
  int log2_table = 17;
  int base = 32;
  double growth = 2.0;
};

// Resolution of a level, cells an axis, before it is rounded: base * growth^level. The finest is `levels` - 1.
double hash_grid_resolution(const HashGridOptions& options, int level);

// HashGrid::entry_count() of a grid with these options, without making it.
std::int64_t hash_grid_entries(const HashGridOptions& options);

class HashGrid {
 public:
  // Table zeroed. Throws InputError for options out of range, MemoryError.
  explicit HashGrid(const HashGridOptions& options);
  const HashGridOptions& options() const { return options_; }
  int feature_count() const { return options_.levels * options_.features; }
  std::int64_t entry_count() const { return offsets_.back(); }        // vectors of F floats
  std::span<const std::int64_t> offsets() const { return offsets_; }  // [levels + 1]
  std::span<float> table() { return table_.span(); }                  // [entries][F]
  std::span<const float> table() const { return table_.span(); }
  HashGridView view() const;  // valid while the grid lives

  // p: positions in [0,1]^3 (clamped, NaN to 0). out feature-major [levels F][stride]. SIMD, thread-safe.
  void lookup(const Vec3f* p, int n, float* out, int stride) const;
  // Also writes (taps is resized, old contents are lost) 8 taps a level and query: taps[(i * levels + level) * 8 +
  // corner].
  void lookup_record(const Vec3f* p, int n, float* out, int stride, std::vector<Tap>& taps) const;

 private:
  HashGridOptions options_;
  std::vector<std::int64_t> offsets_;
  std::vector<HashGridLevelView> levels_;
  HugeArray table_;
};

}  // namespace octrad
