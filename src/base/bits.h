// Bits of a word, on host and device.
#pragma once

#include <cstdint>

#include "base/hd.h"

namespace octrad {

// How many bits are set.
OCTRAD_HD inline std::uint32_t count_bits(std::uint32_t bits) {
#if defined(__CUDA_ARCH__)
  return static_cast<std::uint32_t>(__popc(bits));
#else
  return static_cast<std::uint32_t>(__builtin_popcount(bits));
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
