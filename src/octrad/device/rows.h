// Shared by kernels that work row by row: vector loads of rows, atomic sums into rows with a list of the rows touched,
// and the length of a queue.
#pragma once

#include <cstdint>
#include <cstring>

#include "octrad/base/half.h"
#include "octrad/device/launch.h"

namespace octrad {

// The length of a queue: kernels are launched for its capacity and skip items from *count on. `first`: position in the
// queue of the launch's item 0. A null count: every item is valid.
struct QueueSlice {
  const std::uint32_t* count = nullptr;
  std::uint32_t first = 0;

  OCTRAD_HD bool holds(std::uint32_t i) const { return count == nullptr || first + i < *count; }
};

// Row `row` of a table of C-vectors (C = 2, 4, 8; the table is aligned to 16 bytes) as floats.
template <int C>
OCTRAD_HD inline void load_row(const float* table, std::uint32_t row, float* out) {
  static_assert(C == 2 || C == 4 || C == 8);
  const float* t = table + static_cast<std::uint64_t>(row) * C;
#if defined(__CUDA_ARCH__)
  if constexpr (C == 2) {
    const float2 v = __ldg(reinterpret_cast<const float2*>(t));
    out[0] = v.x;
    out[1] = v.y;
  } else {
    OCTRAD_UNROLL
    for (int c = 0; c < C; c += 4) {
      const float4 v = __ldg(reinterpret_cast<const float4*>(t + c));
      out[c] = v.x;
      out[c + 1] = v.y;
      out[c + 2] = v.z;
      out[c + 3] = v.w;
    }
  }
#else
  std::memcpy(out, t, C * sizeof(float));
#endif
}
template <int C>
OCTRAD_HD inline void load_row(const Half* table, std::uint32_t row, float* out) {
  static_assert(C == 2 || C == 4 || C == 8);
  const Half* t = table + static_cast<std::uint64_t>(row) * C;
  std::uint32_t words[C / 2];
#if defined(__CUDA_ARCH__)
  if constexpr (C == 2) {
    words[0] = __ldg(reinterpret_cast<const unsigned*>(t));
  } else if constexpr (C == 4) {
    const uint2 v = __ldg(reinterpret_cast<const uint2*>(t));
    words[0] = v.x;
    words[1] = v.y;
  } else {
    const uint4 v = __ldg(reinterpret_cast<const uint4*>(t));
    words[0] = v.x;
    words[1] = v.y;
    words[2] = v.z;
    words[3] = v.w;
  }
#else
  std::memcpy(words, t, sizeof(words));
#endif
  OCTRAD_UNROLL
  for (int c = 0; c < C; c += 2) {
    const Vec2f v = unpack_halves(words[c / 2]);
    out[c] = v.x;
    out[c + 1] = v.y;
  }
}

// Adds `scale` times `x` to C floats at `sum` (aligned to their size up to 16 bytes).
template <int C>
OCTRAD_HD inline void atomic_add_row(float* sum, float scale, const float* x) {
#if defined(__CUDA_ARCH__) && __CUDA_ARCH__ >= 900
  if constexpr (C == 2) {
    atomicAdd(reinterpret_cast<float2*>(sum), make_float2(scale * x[0], scale * x[1]));
  } else {
    OCTRAD_UNROLL
    for (int c = 0; c < C; c += 4) {
      atomicAdd(reinterpret_cast<float4*>(sum + c),
                make_float4(scale * x[c], scale * x[c + 1], scale * x[c + 2], scale * x[c + 3]));
    }
  }
#else
  OCTRAD_UNROLL
  for (int c = 0; c < C; ++c) atomic_add(sum + c, scale * x[c]);
#endif
}

// Rows of a table that received a contribution: one bit each, and a list of them in the order of arrival.
struct TouchedRows {
  std::uint32_t* bits = nullptr;  // [(rows + 31) / 32]; null: not recorded
  std::uint32_t* list = nullptr;  // capacity for every row that can be touched; null: bits only
  std::uint32_t* count = nullptr;

  OCTRAD_HD void touch(std::uint32_t row) const {
    if (bits == nullptr) return;
    const std::uint32_t bit = 1u << (row & 31u);
    if ((relaxed_load(&bits[row >> 5]) & bit) != 0) return;  // a stale read is harmless: atomic_or decides
    if ((atomic_or(&bits[row >> 5], bit) & bit) == 0 && list != nullptr) list[atomic_append(count)] = row;
  }
};

// Where contributions `scale * x` to rows of a gradient [rows][C] go. AddNow sums them as they come (their order, hence
// the last bits, changes from run to run); KeepForSort stores each in its slot, so that they
// can be sorted by row and summed in the order of slots.
struct AddNow {
  float* gradient = nullptr;
  TouchedRows touched;

  template <int C>
  OCTRAD_HD void add(std::uint64_t, std::uint32_t row, float scale, const float* x) const {
    touched.touch(row);
    atomic_add_row<C>(gradient + static_cast<std::uint64_t>(row) * C, scale, x);
  }
};
inline constexpr std::uint32_t kNoRow = 0xffffffffu;
struct KeepForSort {
  std::uint32_t* rows = nullptr;  // [slots], kNoRow where nothing is written
  float* scales = nullptr;        // [slots]

  template <int C>
  OCTRAD_HD void add(std::uint64_t slot, std::uint32_t row, float scale, const float*) const {
    rows[slot] = row;
    scales[slot] = scale;
  }
};

}  // namespace octrad
