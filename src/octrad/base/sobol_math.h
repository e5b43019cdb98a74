// Randomised low-discrepancy points: the first three dimensions of Sobol's sequence (Sobol 1967; direction numbers of
// the primitive polynomials 1, x + 1 and x^2 + x + 1) under a random digital shift (Kollig and Keller 2002). Every
// point is uniform in the unit cube by itself, and any 2^k points from the start of the sequence are stratified in the
// first two dimensions.
#pragma once

#include <cstdint>

#include "octrad/base/rng.h"

namespace octrad {

// Coordinates of point `index` as 32-bit fractions.
OCTRAD_HD constexpr void sobol3(std::uint32_t index, std::uint32_t fraction[3]) {
  std::uint32_t a = 1u << 31, b = 1u << 31, c = 1u << 31, c_next = 3u << 30;  // direction numbers of the current digit
  fraction[0] = fraction[1] = fraction[2] = 0;
  for (; index != 0; index >>= 1) {
    if ((index & 1u) != 0) {
      fraction[0] ^= a;
      fraction[1] ^= b;
      fraction[2] ^= c;
    }
    a >>= 1;
    b ^= b >> 1;
    const std::uint32_t c_after = c_next ^ c ^ (c >> 2);  // m_k = 2 m_(k-1) ^ 4 m_(k-2) ^ m_(k-2), as fractions
    c = c_next;
    c_next = c_after;
  }
}

// One such set of points; sets made from one generator are independent of each other. Of generators of samples
// (Rng::of_sample) points of an index are stratified over samples too.
class SobolSet {
 public:
  struct Sample {
    Vec2f u2;  // stratified together
    float u1;  // the third dimension, for a discrete choice: a lobe, a light
  };

  OCTRAD_HD explicit SobolSet(Rng& rng) {
    const BitPair together = rng.stratified_bits2();
    shift_[0] = together.x;
    shift_[1] = together.y;
    shift_[2] = rng.stratified_bits();
  }

  OCTRAD_HD Sample operator()(std::uint32_t index) const {
    std::uint32_t fraction[3];
    sobol3(index, fraction);
    return (*this)(fraction);
  }
  // The point whose coordinates sobol3() gives.
  OCTRAD_HD Sample operator()(const std::uint32_t fraction[3]) const {
    return {{unit_float(fraction[0] ^ shift_[0]), unit_float(fraction[1] ^ shift_[1])},
            unit_float(fraction[2] ^ shift_[2])};
  }

 private:
  std::uint32_t shift_[3];
};

}  // namespace octrad
