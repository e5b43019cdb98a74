#include "octrad/encoding/prefiltered_grid.h"

#include <algorithm>

#include "octrad/encoding/hash_grid_simd.h"

namespace octrad {
namespace {

// Level by level, the queries that read it together.
struct Gathered {
  std::vector<int> query;
  std::vector<int> side;  // 0: the blend's level, 1: the next
  std::vector<float> weight;
  std::vector<Vec3f> p;
  std::vector<float> values;  // [features][query]
  std::vector<Tap> taps;      // [query][8]
  void clear() {
    query.clear();
    side.clear();
    weight.clear();
    p.clear();
  }
  void add(int i, int of_side, float with, Vec3f at) {
    query.push_back(i);
    side.push_back(of_side);
    weight.push_back(with);
    p.push_back(at);
  }
};

}  // namespace

void prefiltered_lookup(const HashGridView& grid, const Vec3f* p, const float* r, int n, float* out, int stride,
                        PrefilteredRecord* record) {
  thread_local std::vector<LevelBlend<float>> local;
  thread_local Gathered g;
  std::vector<LevelBlend<float>>& blends = record != nullptr ? record->blends : local;
  blends.resize(static_cast<std::size_t>(n));
  for (int i = 0; i < n; ++i) blends[static_cast<std::size_t>(i)] = blend_levels(grid, r[i]);
  if (record != nullptr) record->taps.resize(static_cast<std::size_t>(n) * 16);
  for (int f = 0; f < grid.features; ++f) std::fill_n(out + static_cast<std::ptrdiff_t>(f) * stride, n, 0.0f);

  HashGridView one = grid;
  one.levels = 1;
  for (int l = 0; l < grid.levels; ++l) {
    g.clear();
    for (int i = 0; i < n; ++i) {
      const LevelBlend<float>& b = blends[static_cast<std::size_t>(i)];
      if (b.level == l) g.add(i, 0, b.weight, p[i]);
      else if (b.level + 1 == l && b.weight < 1.0f) g.add(i, 1, 1.0f - b.weight, p[i]);
    }
    const std::size_t count = g.query.size();
    if (count == 0) continue;
    one.level[0] = grid.level[l];
    g.values.resize(count * static_cast<std::size_t>(grid.features));
    if (record != nullptr) g.taps.resize(count * 8);
    hash_grid_lookup(one, g.p.data(), static_cast<int>(count), g.values.data(), static_cast<int>(count),
                     record != nullptr ? g.taps.data() : nullptr);
    for (int f = 0; f < grid.features; ++f) {
      const float* from = g.values.data() + static_cast<std::size_t>(f) * count;
      float* to = out + static_cast<std::ptrdiff_t>(f) * stride;
      for (std::size_t j = 0; j < count; ++j) to[g.query[j]] += g.weight[j] * from[j];
    }
    for (std::size_t j = 0; record != nullptr && j < count; ++j) {
      Tap* to = record->taps.data() + static_cast<std::size_t>(g.query[j] * 2 + g.side[j]) * 8;
      for (std::size_t c = 0; c < 8; ++c) to[c] = {g.taps[j * 8 + c].entry, g.taps[j * 8 + c].weight * g.weight[j]};
    }
  }
}

}  // namespace octrad
