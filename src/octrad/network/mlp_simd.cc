// The matrix product of the multi-layer perceptron for every instruction set (Highway's dynamic dispatch: this file is
// compiled once per target). The inner block keeps rows x vectors sums in registers: 8 x 3 with 32 registers of 16
// floats (24 FMA per 3 loads and 8 broadcasts), 6 x 2 with 16 registers of 8 floats.
#include "octrad/network/mlp_simd.h"

// SSSE3 and AVX-512 "DL" would give the same code as the next smaller sets.
#define HWY_DISABLED_TARGETS (HWY_SSSE3 | HWY_AVX3_DL)

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "octrad/network/mlp_simd.cc"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include <algorithm>

HWY_BEFORE_NAMESPACE();
namespace octrad {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using D = hn::CappedTag<float, kPanel>;
using V = hn::Vec<D>;
constexpr std::size_t kLanes = hn::MaxLanes(D());
constexpr std::size_t kVectors = kPanel / kLanes;  // vectors a panel
// Registers: AVX-512 and Arm have 32, the others 16.
#if HWY_TARGET == HWY_AVX3 || HWY_ARCH_ARM
constexpr std::size_t kRegisters = 32;
#else
constexpr std::size_t kRegisters = 16;
#endif
constexpr std::size_t kMaxPanels = kVectors == 1 ? 3 : 1;
constexpr std::size_t kMaxRows = kRegisters == 32 ? (kVectors == 1 ? 8 : 6) : (kVectors == 2 ? 6 : 2);

// One block of C: kRows x kPanels panels, all its sums in registers. Not inlined: with literal sizes GCC 12 unrolls
// the loop over k and spills.
template <std::size_t kRows, std::size_t kPanels, bool kTransposed>
HWY_NOINLINE void block(const GemmArgs& g, const float* HWY_RESTRICT a, const float* HWY_RESTRICT b,
                        float* HWY_RESTRICT c, const float* HWY_RESTRICT mask) {
  const D d;
  constexpr std::size_t kN = kPanels * kVectors;
  V sum[kRows][kN];
  const std::size_t b_panel = g.b_panel, b_stride = g.b_stride, a_stride = g.a_stride;
  if (g.post == GemmArgs::Post::accumulate) {
    for (std::size_t r = 0; r < kRows; ++r) {
      for (std::size_t v = 0; v < kN; ++v) sum[r][v] = hn::LoadU(d, c + r * g.c_stride + v * kLanes);
    }
  } else {
    for (std::size_t r = 0; r < kRows; ++r) {
      for (std::size_t v = 0; v < kN; ++v) sum[r][v] = hn::Zero(d);
    }
  }
  const float* rows[kRows];
  for (std::size_t r = 0; r < kRows; ++r) rows[r] = kTransposed ? a + r : a + r * a_stride;
  std::size_t ka = 0;
  for (std::size_t k = 0; k < g.depth; ++k) {
    V x[kN];
    for (std::size_t p = 0; p < kPanels; ++p) {
      for (std::size_t v = 0; v < kVectors; ++v) x[p * kVectors + v] = hn::LoadU(d, b + p * b_panel + v * kLanes);
    }
    for (std::size_t r = 0; r < kRows; ++r) {
      const V w = hn::Set(d, kTransposed ? a[ka + r] : rows[r][k]);
      for (std::size_t v = 0; v < kN; ++v) sum[r][v] = hn::MulAdd(w, x[v], sum[r][v]);
    }
    b += b_stride;
    if constexpr (kTransposed) ka += a_stride;
  }
  const V zero = hn::Zero(d);
  switch (g.post) {
    case GemmArgs::Post::relu:
      // Not Max(): a NaN must pass, to be seen and counted at the output.
      for (std::size_t r = 0; r < kRows; ++r) {
        for (std::size_t v = 0; v < kN; ++v) {
          hn::StoreU(hn::IfThenZeroElse(hn::Lt(sum[r][v], zero), sum[r][v]), d, c + r * g.c_stride + v * kLanes);
        }
      }
      break;
    case GemmArgs::Post::masked:
      for (std::size_t r = 0; r < kRows; ++r) {
        for (std::size_t v = 0; v < kN; ++v) {
          const V m = hn::LoadU(d, mask + r * g.mask_stride + v * kLanes);
          hn::StoreU(hn::IfThenElseZero(hn::Gt(m, zero), sum[r][v]), d, c + r * g.c_stride + v * kLanes);
        }
      }
      break;
    default:
      for (std::size_t r = 0; r < kRows; ++r) {
        for (std::size_t v = 0; v < kN; ++v) hn::StoreU(sum[r][v], d, c + r * g.c_stride + v * kLanes);
      }
  }
}

// As many blocks of kRows rows as fit after row `r`, then the remainder in blocks of half the rows.
template <std::size_t kRows, std::size_t kPanels, bool kTransposed>
void rows_of(const GemmArgs& g, std::size_t panel, std::size_t r) {
  for (; r + kRows <= g.rows; r += kRows) {
    block<kRows, kPanels, kTransposed>(g, g.a + r * (kTransposed ? 1 : g.a_stride), g.b + panel * g.b_panel,
                                       g.c + r * g.c_stride + panel * kPanel,
                                       g.mask == nullptr ? nullptr : g.mask + r * g.mask_stride + panel * kPanel);
  }
  constexpr std::size_t kNext = kRows > 4 ? 4 : kRows / 2;
  if constexpr (kNext > 0) {
    if (r < g.rows) rows_of<kNext, kPanels, kTransposed>(g, panel, r);
  }
}

template <bool kTransposed>
void panels_of(const GemmArgs& g) {
  std::size_t p = 0;
  while (p < g.panels) {
    // Four left are two and two: a block of one panel has too few sums to hide the latency of FMA.
    const std::size_t left = g.panels - p;
    const std::size_t now = left == 4 ? std::min<std::size_t>(kMaxPanels, 2) : std::min(kMaxPanels, left);
    if constexpr (kMaxPanels >= 3) {
      if (now == 3) rows_of<kMaxRows, 3, kTransposed>(g, p, 0);
      if (now == 2) rows_of<kMaxRows, 2, kTransposed>(g, p, 0);
    }
    if (now == 1) rows_of<kMaxRows, 1, kTransposed>(g, p, 0);
    p += now;
  }
}

void gemm_target(const GemmArgs& g) {
  if (g.a_transposed) {
    panels_of<true>(g);
  } else {
    panels_of<false>(g);
  }
}

const char* name_target() { return hwy::TargetName(HWY_TARGET); }

}  // namespace HWY_NAMESPACE
}  // namespace octrad
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace octrad {
HWY_EXPORT(gemm_target);
HWY_EXPORT(name_target);

void gemm(const GemmArgs& args) { HWY_DYNAMIC_DISPATCH(gemm_target)(args); }
const char* network_simd_name() { return HWY_DYNAMIC_DISPATCH(name_target)(); }

}  // namespace octrad
#endif
