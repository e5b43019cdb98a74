// Counter-based random numbers: every number is a function of (seed, purpose, index, dimension), never of the
// thread that draws it. Mixing: splitmix64's finaliser (Steele et al. 2014), applied to two keys.
#pragma once

#include <cmath>
#include <cstdint>

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
  area = 3,       // left-hand-side area samples
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
  test = 100,
};

class Rng {
 public:
  OCTRAD_HD Rng(std::uint64_t seed, RngPurpose purpose, std::uint64_t index)
      : key_(mix64(mix64(seed + 0x9e3779b97f4a7c15ull * static_cast<std::uint64_t>(purpose)) ^
                   (index * 0xd1342543de82ef95ull + 1))) {}

  // Uniform bits; each call is the next dimension.
  OCTRAD_HD std::uint32_t bits() {
    return static_cast<std::uint32_t>(mix64(key_ + 0x9e3779b97f4a7c15ull * ++dimension_) >> 32);
  }
  // Uniform in [0, 1).
  OCTRAD_HD float uniform() { return static_cast<float>(bits() >> 8) * 0x1p-24f; }
  OCTRAD_HD Vec2f uniform2() {
    const std::uint64_t z = mix64(key_ + 0x9e3779b97f4a7c15ull * ++dimension_);
    return {static_cast<float>(z >> 40) * 0x1p-24f, static_cast<float>((z >> 8) & 0xffffff) * 0x1p-24f};
  }
  // Uniform integer in [0, n), n > 0.
  OCTRAD_HD std::uint32_t below(std::uint32_t n) {
    return static_cast<std::uint32_t>((static_cast<std::uint64_t>(bits()) * n) >> 32);
  }

 private:
  std::uint64_t key_;
  std::uint64_t dimension_ = 0;
};

// Uniform on the unit sphere.
OCTRAD_HD inline Vec3f uniform_direction(Vec2f u) {
  const float z = 1.0f - 2.0f * u.x;
  const float r = std::sqrt(std::fmax(0.0f, 1.0f - z * z));
  return {r * std::cos(2.0f * kPi * u.y), r * std::sin(2.0f * kPi * u.y), z};
}

}  // namespace octrad
