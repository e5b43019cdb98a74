// Counter-based random numbers: every number is a function of (seed, purpose, index, sample, dimension), never of the
// thread that draws it. Mixing: splitmix64's finaliser (Steele et al. 2014), applied to two keys.
#pragma once

#include <cmath>
#include <cstdint>

#include "octrad/base/bits.h"
#include "octrad/base/circle_math.h"
#include "octrad/base/owen_math.h"
#include "octrad/base/vec.h"

namespace octrad {

OCTRAD_HD constexpr std::uint64_t mix64(std::uint64_t z) {
  z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ull;
  z = (z ^ (z >> 27)) * 0x94d049bb133111ebull;
  return z ^ (z >> 31);
}

// What a stream of random numbers is for. Streams of different purposes never share numbers.
enum class RngPurpose : std::uint64_t {
  pixel = 1,      // camera rays and paths of the integrators
  walk = 2,       // left-hand-side random walks
  rhs = 4,        // right-hand-side estimator
  weights = 5,    // network initialisation
  occupancy = 6,  // sampled octree construction
  poses = 7,      // generated camera poses
  validation = 8,
  chain = 9,     // right-hand-side rays through masks and over mirrors and glass
  lobe = 10,     // rays drawn from the BSDF of left-hand-side points
  far_end = 11,  // choice among the ends of a point's right-hand-side rays
  domain = 12,   // rays that find what is seen
  lamps = 13,    // points and light samples that find small lamps
  changed = 14,  // training points on what changed in the scene, and on what it lights
  picks = 15,    // paths that measure how likely emitters should be picked
  test = 100,
};

class Rng {
 public:
  OCTRAD_HD Rng(std::uint64_t seed, RngPurpose purpose, std::uint64_t index)
      : key_(mix64(mix64(seed + 0x9e3779b97f4a7c15ull * static_cast<std::uint64_t>(purpose)) ^
                   (index * 0xd1342543de82ef95ull + 1))) {}
  // The generator of sample `sample` of an estimate with many, such as a pixel (`index`): the numbers of stratified()
  // and its like are stratified over the samples, in each dimension by itself (owen_math.h). From other generators they
  // are as the rest.
  OCTRAD_HD static Rng of_sample(std::uint64_t seed, RngPurpose purpose, std::uint64_t index, std::uint32_t sample) {
    Rng rng(seed, purpose, index);
    rng.sample_ = sample + 1;
    return rng;
  }
  // The same for another purpose, by the sample_key() of the first generator.
  OCTRAD_HD static Rng of_sample_key(std::uint64_t seed, RngPurpose purpose, std::uint64_t index, std::uint64_t key) {
    return of_sample(seed, purpose, index ^ (key >> 24), static_cast<std::uint32_t>(key & 0xffffff));
  }
  // 40 bits of the estimate and 24 of the sample.
  OCTRAD_HD std::uint64_t sample_key() const { return (key_ << 24) | ((sample_ - 1) & 0xffffff); }

  // Uniform bits; each call is the next dimension.
  OCTRAD_HD std::uint32_t bits() { return static_cast<std::uint32_t>(next() >> 32); }
  // Uniform in [0, 1).
  OCTRAD_HD float uniform() { return unit_float(bits()); }
  OCTRAD_HD Vec2f uniform2() {
    const std::uint64_t z = next();
    return {unit_float(static_cast<std::uint32_t>(z >> 32)), unit_float(static_cast<std::uint32_t>(z))};
  }
  // Uniform integer in [0, n), n > 0.
  OCTRAD_HD std::uint32_t below(std::uint32_t n) {
    return static_cast<std::uint32_t>((static_cast<std::uint64_t>(bits()) * n) >> 32);
  }

  // The same, stratified over samples where this is the generator of one: two numbers of bits together, one of them,
  // and both in [0, 1).
  OCTRAD_HD BitPair stratified_bits2() {
    if (sample_ == 0) {
      const std::uint32_t x = bits();
      return {x, bits()};
    }
    const std::uint64_t z = mix64(key_ + kStep * ++dimension_);
    return owen2(sample_ - 1, z, static_cast<std::uint32_t>(mix64(z)));
  }
  OCTRAD_HD std::uint32_t stratified_bits() {
    if (sample_ == 0) return bits();
    return owen1(sample_ - 1, mix64(key_ + kStep * ++dimension_));
  }
  OCTRAD_HD Vec2f stratified2() {
    if (sample_ == 0) return uniform2();
    const BitPair b = stratified_bits2();
    return {unit_float(b.x), unit_float(b.y)};
  }
  OCTRAD_HD float stratified() { return unit_float(stratified_bits()); }

 private:
  static constexpr std::uint64_t kStep = 0x9e3779b97f4a7c15ull;

  OCTRAD_HD std::uint64_t next() { return mix64(key_ + kStep * ((std::uint64_t{sample_} << 32) | ++dimension_)); }

  std::uint64_t key_;
  std::uint32_t dimension_ = 0;
  std::uint32_t sample_ = 0;  // + 1; 0: not of a sample
};

// Uniform on the unit sphere.
OCTRAD_HD inline Vec3f uniform_direction(Vec2f u) {
  const float z = 1.0f - 2.0f * u.x;
  const float r = std::sqrt(std::fmax(0.0f, 1.0f - z * z));
  const Vec2f around = circle_point(u.y);
  return {r * around.x, r * around.y, z};
}

}  // namespace octrad
