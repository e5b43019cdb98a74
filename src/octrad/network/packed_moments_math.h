// Both moments of Adam in one word: two bfloat16, which have the exponents of floats. A mean of squares that moves by a
// thousandth a step moves by less than half of a bfloat16's last place, so rounding to nearest would hold it where it
// is; rounding up or down by chance keeps its expected value (Gupta et al. 2015, "Deep Learning with Limited Numerical
// Precision").
#pragma once

#include <cstdint>
#include <cstring>

#include "octrad/base/rng.h"

namespace octrad {

// Four numbers of 16 bits, one for each of the components 4 (number / 4) .. + 3 of a table, in a step that has `step`.
OCTRAD_HD inline std::uint64_t four_roundings(std::uint64_t step, std::uint64_t number) {
  return mix64(step + 0x9e3779b97f4a7c15ull * (number / 4));
}
OCTRAD_HD inline std::uint32_t rounding_of(std::uint64_t four, std::uint64_t number) {
  return static_cast<std::uint32_t>(four >> number % 4 * 16) & 0xffffu;
}

// The float below or above `x` in magnitude whose last 16 bits are 0; `random`: 16 bits. What is such a float stays;
// what is finite stays finite.
OCTRAD_HD inline std::uint32_t rounded_by_chance(float x, std::uint32_t random) {
  std::uint32_t bits;
  std::memcpy(&bits, &x, sizeof(bits));
  const std::uint32_t sign = bits & 0x80000000u, size = (bits & 0x7fffffffu) + random;
  return sign | ((size < 0x7f7fffffu ? size : 0x7f7fffffu) & 0xffff0000u);
}

// m and v are finite.
OCTRAD_HD inline std::uint32_t pack_moments(float m, float v, std::uint32_t random) {
  return rounded_by_chance(m, random) | rounded_by_chance(v, random) >> 16;
}

OCTRAD_HD inline void unpack_moments(std::uint32_t word, float& m, float& v) {
  const std::uint32_t high = word & 0xffff0000u, low = word << 16;
  std::memcpy(&m, &high, sizeof(m));
  std::memcpy(&v, &low, sizeof(v));
}

}  // namespace octrad
