// Level by level over blocks, in two stages as in octaoctree_simd.cc: entries and weights for as many queries as a
// vector has lanes, then, one step later, sums of feature vectors query by query.
#include "octrad/encoding/hash_grid_simd.h"

#include <hwy/cache_control.h>

#include <algorithm>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "octrad/encoding/hash_grid_simd.cc"
#include <hwy/foreach_target.h>  // must come before highway.h
#include <hwy/highway.h>

#include "octrad/encoding/feature_rows-inl.h"

HWY_BEFORE_NAMESPACE();
namespace octrad {
namespace HWY_NAMESPACE {

constexpr int kGridBlock = 256;  // queries processed level by level

struct GridTaps {
  alignas(64) std::uint32_t entry[8][kLanes];
  alignas(64) float weight[8][kLanes];
};

// p: [3][kGridBlock], clamped to [0, 1].
HWY_NOINLINE void grid_address_stage(const HashGridLevelView& level, const float* p, GridTaps& taps) {
  const F f;
  const I di;
  const U du;
  const VF one = hn::Set(f, 1.0f);
  VF weight[3][2];
  VU part[3][2];  // of the dense index or of the hash
  const std::uint32_t dense_factor[3] = {1u, level.resolution, level.resolution * level.resolution};
  const std::uint32_t hash_factor[3] = {1u, 2654435761u, 805459861u};
  for (int a = 0; a < 3; ++a) {
    const VF g = hn::MulAdd(hn::Load(f, p + a * kGridBlock), hn::Set(f, level.scale), hn::Set(f, 0.5f));
    const VF base = hn::Floor(g);
    weight[a][1] = hn::Sub(g, base);
    weight[a][0] = hn::Sub(one, weight[a][1]);
    const VU factor = hn::Set(du, level.dense ? dense_factor[a] : hash_factor[a]);
    part[a][0] = hn::Mul(hn::BitCast(du, hn::ConvertTo(di, base)), factor);
    part[a][1] = hn::Add(part[a][0], factor);
  }
  const VU first = hn::Set(du, level.first_entry), entries = hn::Set(du, level.entries),
           mask = hn::Set(du, level.entries - 1);
  for (int c = 0; c < 8; ++c) {
    const VU x = part[0][c & 1], y = part[1][c >> 1 & 1], z = part[2][c >> 2];
    VU entry;
    if (level.dense) {
      const VU index = hn::Add(hn::Add(x, y), z);       // below twice the entries
      entry = hn::Min(index, hn::Sub(index, entries));  // wraps to a large number where it is below
    } else {
      entry = hn::And(hn::Xor(hn::Xor(x, y), z), mask);
    }
    hn::Store(hn::Add(entry, first), du, taps.entry[c]);
    hn::Store(hn::Mul(hn::Mul(weight[0][c & 1], weight[1][c >> 1 & 1]), weight[2][c >> 2]), f, taps.weight[c]);
  }
}

template <int C>
HWY_INLINE void grid_prefetch(const float* HWY_RESTRICT table, const GridTaps& taps, int lanes) {
  for (int c = 0; c < 8; ++c) {
    for (int q = 0; q < lanes; ++q) hwy::Prefetch(table + std::size_t{taps.entry[c][q]} * C);
  }
}

template <int C>
HWY_NOINLINE void grid_gather_stage(const float* HWY_RESTRICT table, const GridTaps& taps, int lanes,
                                    float* HWY_RESTRICT value) {
  const Feature<C> f;
  constexpr int kStep = C / kParts<C>;
  for (int q = 0; q < lanes; ++q) {
    hn::Vec<Feature<C>> sum[kParts<C>];
    for (int part = 0; part < kParts<C>; ++part) sum[part] = hn::Zero(f);
    for (int c = 0; c < 8; ++c) {
      const float* t = table + std::size_t{taps.entry[c][q]} * C;
      const auto w = hn::Set(f, taps.weight[c][q]);
      for (int part = 0; part < kParts<C>; ++part) sum[part] = hn::MulAdd(w, hn::Load(f, t + part * kStep), sum[part]);
    }
    for (int part = 0; part < kParts<C>; ++part) hn::Store(sum[part], f, value + q * C + part * kStep);
  }
}

template <int C>
void grid_lookup(const HashGridView& view, const Vec3f* p, int n, float* out, std::int64_t stride, Tap* taps) {
  const int lanes = static_cast<int>(hn::Lanes(F()));
  alignas(64) float position[3 * kGridBlock];
  alignas(64) float value[kLanes * C];
  GridTaps ring[2];
  for (int begin = 0; begin < n; begin += kGridBlock) {
    const int count = std::min(kGridBlock, n - begin), steps = (count + lanes - 1) / lanes;
    for (int i = 0; i < steps * lanes; ++i) {
      for (int a = 0; a < 3; ++a) position[a * kGridBlock + i] = clamp_unit(p[begin + std::min(i, count - 1)][a]);
    }
    const int total = steps * view.levels;
    for (int step = 0; step <= total; ++step) {
      if (step < total) {
        GridTaps& next = ring[step & 1];
        grid_address_stage(view.level[step / steps], position + step % steps * lanes, next);
        grid_prefetch<C>(view.table, next, lanes);
      }
      if (step > 0) {
        const GridTaps& now = ring[(step - 1) & 1];
        const int level = (step - 1) / steps, first = (step - 1) % steps * lanes,
                  valid = std::min(lanes, count - first);
        grid_gather_stage<C>(view.table, now, lanes, value);
        write_rows<C>(value, valid, out + level * C * stride + begin + first, stride);
        if (taps != nullptr) {
          for (int q = 0; q < valid; ++q) {
            Tap* tap = taps + (static_cast<std::int64_t>(begin + first + q) * view.levels + level) * 8;
            for (int c = 0; c < 8; ++c) tap[c] = {now.entry[c][q], now.weight[c][q]};
          }
        }
      }
    }
  }
}

void grid_lookup_target(const HashGridView& view, const Vec3f* p, int n, float* out, std::int64_t stride, Tap* taps) {
  switch (view.features) {
    case 2: return grid_lookup<2>(view, p, n, out, stride, taps);
    case 4: return grid_lookup<4>(view, p, n, out, stride, taps);
    default: return grid_lookup<8>(view, p, n, out, stride, taps);
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace octrad
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace octrad {

HWY_EXPORT(grid_lookup_target);

void hash_grid_lookup(const HashGridView& view, const Vec3f* p, int n, float* out, int stride, Tap* taps) {
  HWY_DYNAMIC_DISPATCH(grid_lookup_target)(view, p, n, out, stride, taps);
}

}  // namespace octrad
#endif
