// Feature vectors in registers and the transpose to feature-major rows, per SIMD target. Included after <hwy/highway.h>
// by files that foreach_target.h compiles several times; hence the toggled guard.
#include <cstdint>

#if defined(OCTRAD_ENCODING_FEATURE_ROWS_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef OCTRAD_ENCODING_FEATURE_ROWS_INL_H_
#undef OCTRAD_ENCODING_FEATURE_ROWS_INL_H_
#else
#define OCTRAD_ENCODING_FEATURE_ROWS_INL_H_
#endif

HWY_BEFORE_NAMESPACE();
namespace octrad {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

inline constexpr int kLanes = 16;  // most queries in a step

using F = hn::CappedTag<float, kLanes>;
using I = hn::RebindToSigned<F>;
using U = hn::RebindToUnsigned<F>;
using VF = hn::Vec<F>;
using VI = hn::Vec<I>;
using VU = hn::Vec<U>;

// A vector of C features is kParts<C> of these.
inline constexpr int kWidest = HWY_LANES(float) < 8 ? HWY_LANES(float) : 8;
template <int C>
using Feature = hn::FixedTag<float, (C < kWidest ? C : kWidest)>;
template <int C>
inline constexpr int kParts = C < kWidest ? 1 : C / kWidest;

// value[n][C], aligned and of full lanes, to out[c * stride + q].
template <int C>
HWY_INLINE void write_rows(const float* HWY_RESTRICT value, int n, float* HWY_RESTRICT out, std::int64_t stride) {
#if HWY_TARGET != HWY_SCALAR
  const F f;
  if (n == static_cast<int>(hn::Lanes(f))) {
    if constexpr (C == 4) {
      VF a, b, c, d;
      hn::LoadInterleaved4(f, value, a, b, c, d);
      hn::StoreU(a, f, out);
      hn::StoreU(b, f, out + stride);
      hn::StoreU(c, f, out + 2 * stride);
      hn::StoreU(d, f, out + 3 * stride);
      return;
    } else if constexpr (C == 2) {
      VF a, b;
      hn::LoadInterleaved2(f, value, a, b);
      hn::StoreU(a, f, out);
      hn::StoreU(b, f, out + stride);
      return;
    }
  }
#endif
  for (int c = 0; c < C; ++c) {
    for (int q = 0; q < n; ++q) out[c * stride + q] = value[q * C + c];
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace octrad
HWY_AFTER_NAMESPACE();

#endif
