// 16-bit floats (IEEE binary16) and arrays of them, the same on host and device.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>

#if defined(__CUDACC__)
#include <cuda_fp16.h>
#endif

#include "octrad/base/vec.h"

namespace octrad {

inline constexpr float kLargestHalf = 65504.0f;

// What a half holds, and NaN for what is not finite.
OCTRAD_HD inline float bounded_half(float a) {
  return (a > kLargestHalf ? kLargestHalf : (a < -kLargestHalf ? -kLargestHalf : a)) + (a - a);
}

struct Half {
  std::uint16_t bits = 0;
};

// Exact.
OCTRAD_HD inline float to_float(Half h) {
#if defined(__CUDA_ARCH__)
  return __half2float(__ushort_as_half(h.bits));
#else
  const std::uint32_t shifted = (h.bits & 0x7fffu) << 13;
  float value;
  std::memcpy(&value, &shifted, sizeof(value));
  value *= 0x1p112f;  // moves the exponent; subnormals come out right
  std::uint32_t bits;
  std::memcpy(&bits, &value, sizeof(bits));
  if ((h.bits & 0x7c00u) == 0x7c00u) bits = shifted | 0x7f800000u;  // infinite or NaN
  bits |= (h.bits & 0x8000u) << 16;
  std::memcpy(&value, &bits, sizeof(value));
  return value;
#endif
}

// To nearest, ties to even; beyond 65520 infinite.
OCTRAD_HD inline Half to_half(float f) {
#if defined(__CUDA_ARCH__)
  return {__half_as_ushort(__float2half_rn(f))};
#else
  std::uint32_t bits;
  std::memcpy(&bits, &f, sizeof(bits));
  const std::uint32_t sign = bits >> 16 & 0x8000u, magnitude = bits & 0x7fffffffu;
  std::uint32_t half;
  if (magnitude >= 0x47800000u) {
    half = magnitude > 0x7f800000u ? 0x7fffu : 0x7c00u;
  } else if (magnitude < 0x38800000u) {  // subnormal: the addition rounds to multiples of 2^-24
    float value;
    std::memcpy(&value, &magnitude, sizeof(value));
    value += 0.5f;
    std::memcpy(&half, &value, sizeof(half));
    half -= 0x3f000000u;
  } else {
    half = (magnitude + 0xc8000fffu + (magnitude >> 13 & 1u)) >> 13;
  }
  return {static_cast<std::uint16_t>(sign | half)};
#endif
}

// Two in one word, the first in the low half.
OCTRAD_HD inline std::uint32_t pack_halves(float low, float high) {
#if defined(__CUDA_ARCH__)
  const __half2 both = __floats2half2_rn(low, high);
  std::uint32_t word;
  memcpy(&word, &both, sizeof(word));
  return word;
#else
  return to_half(low).bits | static_cast<std::uint32_t>(to_half(high).bits) << 16;
#endif
}
OCTRAD_HD inline Vec2f unpack_halves(std::uint32_t word) {
  return {to_float(Half{static_cast<std::uint16_t>(word & 0xffffu)}),
          to_float(Half{static_cast<std::uint16_t>(word >> 16)})};
}

// Feature f of item i, features 2 k and 2 k + 1 in one word: word [f / 2][stride]. The inputs of networks.
struct HalfRows {
  std::uint32_t* data = nullptr;
  std::size_t stride = 0;  // items

  // f is even: features f and f + 1.
  OCTRAD_HD void store2(int f, std::size_t i, float a, float b) const {
    data[static_cast<std::size_t>(f >> 1) * stride + i] = pack_halves(a, b);
  }
};

// The same as floats: [f][stride].
struct FloatRows {
  float* data = nullptr;
  std::size_t stride = 0;

  OCTRAD_HD void store2(int f, std::size_t i, float a, float b) const {
    data[static_cast<std::size_t>(f) * stride + i] = a;
    data[static_cast<std::size_t>(f + 1) * stride + i] = b;
  }
};

}  // namespace octrad
