// Samples that are stratified in every dimension, in any order of dimensions: the first two dimensions of Sobol's
// sequence under Owen's scrambling by a hash, taken in an order that is shuffled for each dimension, so that dimensions
// are independent of each other (Burley 2020, "Practical Hash-based Owen Scrambling"; the hash has the constants of
// Vegdahl 2021, "Building a Better LK Hash"). Of the samples from a multiple of 2^k on, 2^k form a (0, k, 2)-net:
// every elementary interval of that size holds one.
#pragma once

#include <cstdint>

#include "octrad/base/hd.h"

namespace octrad {

OCTRAD_HD constexpr std::uint32_t reverse_bits(std::uint32_t x) {
  x = ((x >> 1) & 0x55555555u) | ((x & 0x55555555u) << 1);
  x = ((x >> 2) & 0x33333333u) | ((x & 0x33333333u) << 2);
  x = ((x >> 4) & 0x0f0f0f0fu) | ((x & 0x0f0f0f0fu) << 4);
  x = ((x >> 8) & 0x00ff00ffu) | ((x & 0x00ff00ffu) << 8);
  return (x >> 16) | (x << 16);
}

// A random permutation for each seed in which a bit depends on itself and on lower ones: Owen's scrambling of a number
// whose bits are reversed.
OCTRAD_HD constexpr std::uint32_t scramble_upwards(std::uint32_t x, std::uint32_t seed) {
  x ^= x * 0x3d20adeau;
  x += seed;
  x *= (seed >> 16) | 1u;
  x ^= x * 0x05526c56u;
  x ^= x * 0x53a22864u;
  return x;
}

// Place in the sequence of sample `sample`: aligned blocks of 2^k samples stay together.
OCTRAD_HD constexpr std::uint32_t shuffled_place(std::uint32_t sample, std::uint32_t seed) {
  return reverse_bits(scramble_upwards(reverse_bits(sample), seed));
}

// Sobol's second dimension with its bits reversed: bit j is the parity of those bits k of `place` for which the
// binomial coefficient (k over j) is odd, whose binary digits hold those of j.
OCTRAD_HD constexpr std::uint32_t reversed_sobol2(std::uint32_t place) {
  place ^= (place >> 1) & 0x55555555u;
  place ^= (place >> 2) & 0x33333333u;
  place ^= (place >> 4) & 0x0f0f0f0fu;
  place ^= (place >> 8) & 0x00ff00ffu;
  return place ^ (place >> 16);
}

// Coordinates of a sample as 32-bit fractions; `seeds` are 64 random bits.
OCTRAD_HD constexpr std::uint32_t owen1(std::uint32_t sample, std::uint64_t seeds) {
  const std::uint32_t place = shuffled_place(sample, static_cast<std::uint32_t>(seeds));
  return reverse_bits(scramble_upwards(place, static_cast<std::uint32_t>(seeds >> 32)));
}
struct BitPair {
  std::uint32_t x, y;
};
OCTRAD_HD constexpr BitPair owen2(std::uint32_t sample, std::uint64_t seeds, std::uint32_t seed) {
  const std::uint32_t place = shuffled_place(sample, static_cast<std::uint32_t>(seeds));
  return {reverse_bits(scramble_upwards(place, static_cast<std::uint32_t>(seeds >> 32))),
          reverse_bits(scramble_upwards(reversed_sobol2(place), seed))};
}

}  // namespace octrad
