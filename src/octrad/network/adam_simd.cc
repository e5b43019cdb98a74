// Inner loops of Adam for every instruction set. Multiplications and additions stay separate and in the order of
// adam_math.h: the results have the same bits everywhere, and memory, not arithmetic, sets the speed.
#include "octrad/network/adam_simd.h"

// SSSE3 and AVX-512 "DL" would give the same code as the next smaller sets.
#define HWY_DISABLED_TARGETS (HWY_SSSE3 | HWY_AVX3_DL)

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "octrad/network/adam_simd.cc"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include <algorithm>
#include <bit>
#include <limits>

HWY_BEFORE_NAMESPACE();
namespace octrad {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// One vector of parameters. Returns the new values; m and v are updated; gradients that are not usable count as 0.
template <class D, class V = hn::Vec<D>>
HWY_INLINE V update(D d, V p, V g, V& m, V& v, const AdamConstants& k, V scaled_rate, V second, std::int64_t& dropped) {
  V squared = hn::Mul(g, g);
  const auto usable = hn::Le(squared, hn::Set(d, std::numeric_limits<float>::max()));
  if (HWY_UNLIKELY(!hn::AllTrue(d, usable))) {
    dropped += static_cast<std::int64_t>(hn::Lanes(d) - hn::CountTrue(d, usable));
    g = hn::IfThenElseZero(usable, g);
    squared = hn::Mul(g, g);
  }
  m = hn::Add(hn::Mul(hn::Set(d, k.beta1), m), hn::Mul(hn::Set(d, k.rest1), g));
  v = hn::Add(hn::Mul(hn::Set(d, k.beta2), v), hn::Mul(hn::Set(d, k.rest2), squared));
  const V root = hn::Add(hn::Mul(hn::Sqrt(v), second), hn::Set(d, k.epsilon));
  return hn::Sub(p, hn::Div(hn::Mul(scaled_rate, m), root));
}

std::int64_t dense_target(std::size_t n, float* HWY_RESTRICT parameters, const float* HWY_RESTRICT gradients,
                          float* HWY_RESTRICT m, float* HWY_RESTRICT v, const AdamConstants& constants,
                          float scaled_rate, float second) {
  const hn::ScalableTag<float> d;
  const std::size_t lanes = hn::Lanes(d);
  const AdamConstants k = constants;
  const auto rate_v = hn::Set(d, scaled_rate), second_v = hn::Set(d, second);
  std::int64_t dropped = 0;
  std::size_t i = 0;
  for (; i + lanes <= n; i += lanes) {
    auto mean = hn::LoadU(d, m + i), squares = hn::LoadU(d, v + i);
    const auto p = update(d, hn::LoadU(d, parameters + i), hn::LoadU(d, gradients + i), mean, squares, k, rate_v,
                          second_v, dropped);
    hn::StoreU(p, d, parameters + i);
    hn::StoreU(mean, d, m + i);
    hn::StoreU(squares, d, v + i);
  }
  for (; i < n; ++i) {
    const bool usable = adam_usable(gradients[i]);
    dropped += usable ? 0 : 1;
    parameters[i] = adam_update(parameters[i], usable ? gradients[i] : 0.0f, m[i], v[i], k, scaled_rate, second);
  }
  return dropped;
}

// Features of an entry: kFeatures when it is known at compile time (1, 2, 4, 8), else any number (kFeatures = 0).
template <std::size_t kFeatures>
HWY_INLINE void add_scaled(float* HWY_RESTRICT sum, const float* HWY_RESTRICT x, float scale, std::size_t features) {
  if constexpr (kFeatures > 0) {
    const hn::CappedTag<float, kFeatures> d;
    for (std::size_t f = 0; f < kFeatures; f += hn::MaxLanes(d)) {
      hn::StoreU(hn::Add(hn::LoadU(d, sum + f), hn::Mul(hn::Set(d, scale), hn::LoadU(d, x + f))), d, sum + f);
    }
  } else {
    for (std::size_t f = 0; f < features; ++f) sum[f] += scale * x[f];
  }
}

template <std::size_t kFeatures>
HWY_INLINE void update_entry(float* HWY_RESTRICT p, float* HWY_RESTRICT moments, const float* HWY_RESTRICT gradient,
                             const AdamConstants& k, float scaled_rate, float second, std::size_t features,
                             std::int64_t& dropped) {
  if constexpr (kFeatures > 0) {
    const hn::CappedTag<float, kFeatures> d;
    for (std::size_t f = 0; f < kFeatures; f += hn::MaxLanes(d)) {
      auto m = hn::LoadU(d, moments + f), v = hn::LoadU(d, moments + kFeatures + f);
      const auto q = update(d, hn::LoadU(d, p + f), hn::LoadU(d, gradient + f), m, v, k, hn::Set(d, scaled_rate),
                            hn::Set(d, second), dropped);
      hn::StoreU(q, d, p + f);
      hn::StoreU(m, d, moments + f);
      hn::StoreU(v, d, moments + kFeatures + f);
    }
  } else {
    for (std::size_t f = 0; f < features; ++f) {
      const bool usable = adam_usable(gradient[f]);
      dropped += usable ? 0 : 1;
      p[f] = adam_update(p[f], usable ? gradient[f] : 0.0f, moments[f], moments[features + f], k, scaled_rate, second);
    }
  }
}

constexpr std::uint32_t kEmpty = ~0u;

template <std::size_t kFeatures>
SparseAdamCounts sparse(const SparseAdamView& view, std::span<const SparseTap> taps, SparseAdamScratch& scratch) {
  const std::size_t features = kFeatures > 0 ? kFeatures : view.features;
  const std::size_t capacity = std::bit_ceil(2 * taps.size() + 2);
  const int shift = 32 - std::countr_zero(capacity);
  if (scratch.slots.size() < capacity) scratch.slots.resize(capacity);
  if (scratch.entries.size() < taps.size()) {
    scratch.entries.resize(taps.size());
    scratch.gradients.resize(taps.size() * features);
  }
  if (scratch.gradients.size() < taps.size() * features) scratch.gradients.resize(taps.size() * features);
  std::uint32_t* HWY_RESTRICT slots = scratch.slots.data();
  std::uint32_t* HWY_RESTRICT entries = scratch.entries.data();
  float* HWY_RESTRICT gradients = scratch.gradients.data();
  std::fill_n(slots, capacity, kEmpty);

  std::uint32_t touched = 0;
  for (const SparseTap& tap : taps) {
    std::size_t slot = (tap.entry * 2654435769u) >> shift;  // Fibonacci hashing
    while (slots[slot] != kEmpty && entries[slots[slot]] != tap.entry) slot = (slot + 1) & (capacity - 1);
    std::uint32_t index = slots[slot];
    if (index == kEmpty) {
      index = touched++;
      slots[slot] = index;
      entries[index] = tap.entry;
      std::fill_n(gradients + index * features, features, 0.0f);
      // These three lines come from memory; they are needed only after all the sums.
      const std::size_t entry = tap.entry;
      __builtin_prefetch(view.table + entry * features);
      __builtin_prefetch(view.moments + entry * 2 * features);
      __builtin_prefetch(view.counts + entry);
    }
    add_scaled<kFeatures>(gradients + index * features, view.upstream + tap.source * features, tap.scale, features);
  }

  SparseAdamCounts result;
  result.touched = touched;
  const AdamConstants k = view.constants;
  for (std::size_t i = 0; i < touched; ++i) {
    const std::size_t entry = entries[i];
    const std::uint16_t count = view.counts[entry];
    const std::uint16_t now = static_cast<std::uint16_t>(count == 0xffff ? count : count + 1);
    view.counts[entry] = now;
    const AdamCorrection correction = view.corrections[std::min<std::size_t>(now, view.last_correction)];
    update_entry<kFeatures>(view.table + entry * features, view.moments + entry * 2 * features,
                            gradients + i * features, k, view.rate * correction.first, correction.second, features,
                            result.non_finite);
  }
  return result;
}

template <std::size_t kFeatures>
SparseAdamCounts range(const SparseAdamView& view, std::span<const SparseTap> taps, std::size_t first,
                       std::size_t count, AdamCorrection correction, SparseAdamScratch& scratch) {
  const std::size_t features = kFeatures > 0 ? kFeatures : view.features;
  scratch.gradients.assign(count * features, 0.0f);
  float* HWY_RESTRICT gradients = scratch.gradients.data();
  for (const SparseTap& tap : taps) {
    add_scaled<kFeatures>(gradients + (tap.entry - first) * features, view.upstream + tap.source * features, tap.scale,
                          features);
  }
  SparseAdamCounts result;
  result.touched = static_cast<std::int64_t>(count);
  const AdamConstants k = view.constants;
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t entry = first + i;
    update_entry<kFeatures>(view.table + entry * features, view.moments + entry * 2 * features,
                            gradients + i * features, k, view.rate * correction.first, correction.second, features,
                            result.non_finite);
  }
  return result;
}

SparseAdamCounts sparse_target(const SparseAdamView& view, std::span<const SparseTap> taps,
                               SparseAdamScratch& scratch) {
  switch (view.features) {
    case 1: return sparse<1>(view, taps, scratch);
    case 2: return sparse<2>(view, taps, scratch);
    case 4: return sparse<4>(view, taps, scratch);
    case 8: return sparse<8>(view, taps, scratch);
    default: return sparse<0>(view, taps, scratch);
  }
}

SparseAdamCounts range_target(const SparseAdamView& view, std::span<const SparseTap> taps, std::size_t first,
                              std::size_t count, AdamCorrection correction, SparseAdamScratch& scratch) {
  switch (view.features) {
    case 1: return range<1>(view, taps, first, count, correction, scratch);
    case 2: return range<2>(view, taps, first, count, correction, scratch);
    case 4: return range<4>(view, taps, first, count, correction, scratch);
    case 8: return range<8>(view, taps, first, count, correction, scratch);
    default: return range<0>(view, taps, first, count, correction, scratch);
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace octrad
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace octrad {
HWY_EXPORT(dense_target);
HWY_EXPORT(sparse_target);
HWY_EXPORT(range_target);

std::int64_t adam_dense_kernel(std::size_t n, float* parameters, const float* gradients, float* m, float* v,
                               const AdamConstants& k, float scaled_rate, float second) {
  return HWY_DYNAMIC_DISPATCH(dense_target)(n, parameters, gradients, m, v, k, scaled_rate, second);
}

SparseAdamCounts adam_sparse_kernel(const SparseAdamView& view, std::span<const SparseTap> taps,
                                    SparseAdamScratch& scratch) {
  return HWY_DYNAMIC_DISPATCH(sparse_target)(view, taps, scratch);
}

SparseAdamCounts adam_range_kernel(const SparseAdamView& view, std::span<const SparseTap> taps, std::size_t first,
                                   std::size_t entries, AdamCorrection correction, SparseAdamScratch& scratch) {
  return HWY_DYNAMIC_DISPATCH(range_target)(view, taps, first, entries, correction, scratch);
}

}  // namespace octrad
#endif
