// Three feature planes with their table; planes_math.h has the formulas. Template of docs/extending.md.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "octrad/encoding/octaoctree.h"
#include "octrad/encoding/planes_math.h"

namespace octrad {

class Planes {
 public:
  // Table zeroed. Throws InputError for options out of range.
  Planes(int resolution, int features);
  int resolution() const { return resolution_; }
  int features() const { return features_; }
  std::int64_t entry_count() const { return std::int64_t{3} * resolution_ * resolution_; }
  std::span<float> table() { return table_; }  // [entries][features]
  std::span<const float> table() const { return table_; }

  // p: positions in [0,1]^3. out feature-major [features][stride]. taps, where not null: [n][kPlaneTaps]. Thread-safe.
  void lookup(const Vec3f* p, int n, float* out, int stride, Tap* taps) const;

 private:
  int resolution_, features_;
  std::vector<float> table_;
};

}  // namespace octrad
