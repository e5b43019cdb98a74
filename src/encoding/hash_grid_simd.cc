#include "encoding/hash_grid_simd.h"

namespace octrad {

void hash_grid_lookup(const HashGridView& view, const Vec3f* p, int n, float* out, int stride, Tap* taps) {
  for (int i = 0; i < n; ++i) {
    for (int l = 0; l < view.levels; ++l) {
      std::uint32_t entry[8];
      float weight[8];
      hash_grid_taps(view.level[l], p[i], entry, weight);
      for (int f = 0; f < view.features; ++f) {
        float sum = 0.0f;
        for (int c = 0; c < 8; ++c) sum += weight[c] * view.table[static_cast<std::int64_t>(entry[c]) * view.features + f];
        out[static_cast<std::int64_t>(l * view.features + f) * stride + i] = sum;
      }
      if (taps != nullptr) {
        for (int c = 0; c < 8; ++c) taps[(static_cast<std::int64_t>(i) * view.levels + l) * 8 + c] = {entry[c], weight[c]};
      }
    }
  }
}

}  // namespace octrad
