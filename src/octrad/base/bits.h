// Bits of a word, on host and device.
#pragma once

#include <cstdint>
#include <cstring>

#include "octrad/base/hd.h"

namespace octrad {

// A float's bits, and the float of some bits.
OCTRAD_HD inline std::uint32_t bits_of(float value) {
#if defined(__CUDA_ARCH__)
  return __float_as_uint(value);
#else
  std::uint32_t bits;
  std::memcpy(&bits, &value, 4);
  return bits;
#endif
}
OCTRAD_HD inline float float_of(std::uint32_t bits) {
#if defined(__CUDA_ARCH__)
  return __uint_as_float(bits);
#else
  float value;
  std::memcpy(&value, &bits, 4);
  return value;
#endif
}

// `yes` or `no`, without a branch: for choices that cannot be predicted.
OCTRAD_HD inline float choose(bool choice, float yes, float no) {
#if defined(__CUDA_ARCH__)
  return choice ? yes : no;
#else
  const std::uint32_t mask = 0u - static_cast<std::uint32_t>(choice);
  return float_of((bits_of(yes) & mask) | (bits_of(no) & ~mask));
#endif
}

// A number in [0, 1) of the upper 24 bits.
OCTRAD_HD inline float unit_float(std::uint32_t bits) { return static_cast<float>(bits >> 8) * 0x1p-24f; }

// How many bits are set.
OCTRAD_HD inline std::uint32_t count_bits(std::uint32_t bits) {
#if defined(__CUDA_ARCH__)
  return static_cast<std::uint32_t>(__popc(bits));
#else
  return static_cast<std::uint32_t>(__builtin_popcount(bits));
#endif
}

// Index of the lowest bit that is set; bits != 0.
OCTRAD_HD inline std::uint32_t lowest_bit(std::uint32_t bits) {
#if defined(__CUDA_ARCH__)
  return static_cast<std::uint32_t>(__ffs(static_cast<int>(bits)) - 1);
#else
  return static_cast<std::uint32_t>(__builtin_ctz(bits));
#endif
}

// Index of the highest bit that is set; bits != 0.
OCTRAD_HD inline std::uint32_t highest_bit(std::uint32_t bits) {
#if defined(__CUDA_ARCH__)
  return 31u - static_cast<std::uint32_t>(__clz(static_cast<int>(bits)));
#else
  return 31u - static_cast<std::uint32_t>(__builtin_clz(bits));
#endif
}

}  // namespace octrad
