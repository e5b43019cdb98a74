#include "encoding/octaoctree_simd.h"

namespace octrad {

std::int64_t octaoctree_lookup(const OctaOctreeView& view, const Vec3f* x, const Vec3f* w, const float* d, int n, float* out, int stride) {
  std::int64_t empty = 0;
  float value[kMaxOctreeLevels * kMaxOctreeFeatures];
  for (int i = 0; i < n; ++i) {
    empty += lookup_query(view, x[i], w[i], d[i], value, static_cast<float*>(nullptr));
    for (int f = 0; f < view.levels * view.features; ++f) out[f * static_cast<std::int64_t>(stride) + i] = value[f];
  }
  return empty;
}

std::int64_t octaoctree_lookup_record(const OctaOctreeView& view, const Vec3f* x, const Vec3f* w, const float* d, int n, float* out,
                                      int stride, OctaOctree::Record& record) {
  std::int64_t empty = 0;
  float value[kMaxOctreeLevels * kMaxOctreeFeatures], slope[kMaxOctreeLevels * kMaxOctreeFeatures];
  record.taps.clear();
  record.begin.clear();
  record.derivative.assign(static_cast<std::size_t>(view.levels * view.features) * static_cast<std::size_t>(stride), 0.0f);
  for (int i = 0; i < n; ++i) {
    const Vec3f p = normalize_position(view, x[i]);
    record.begin.push_back(static_cast<std::uint32_t>(record.taps.size()));
    for (int l = 0; l < view.levels; ++l) {
      visit_level(view, view.level[l], p, w[i], d[i], [&](std::uint32_t entry, float weight, float) {
        if (weight != 0.0f) record.taps.push_back({entry, weight});
      });
      record.begin.push_back(static_cast<std::uint32_t>(record.taps.size()));
    }
    empty += lookup_query(view, x[i], w[i], d[i], value, slope);
    for (int f = 0; f < view.levels * view.features; ++f) {
      out[f * static_cast<std::int64_t>(stride) + i] = value[f];
      record.derivative[static_cast<std::size_t>(f * static_cast<std::int64_t>(stride) + i)] = slope[f];
    }
  }
  return empty;
}

}  // namespace octrad
