// Made-up inputs of tests, benchmarks and checks of devices: the same for a seed.
#pragma once

#include <span>
#include <vector>

#include "octrad/base/rng.h"

namespace octrad::testing {

inline std::vector<std::uint32_t> random_words(std::size_t n, std::uint64_t seed) {
  std::vector<std::uint32_t> words(n);
  for (std::size_t i = 0; i < n; ++i) words[i] = Rng(seed, RngPurpose::test, i).bits();
  return words;
}

// Uniform between the two.
inline std::vector<float> random_floats(std::size_t n, std::uint64_t seed, float low = -1.0f, float high = 1.0f) {
  std::vector<float> values(n);
  for (std::size_t i = 0; i < n; ++i) values[i] = low + (high - low) * Rng(seed, RngPurpose::test, i).uniform();
  return values;
}

inline std::vector<Vec3f> random_directions(std::size_t n, std::uint64_t seed) {
  std::vector<Vec3f> directions(n);
  for (std::size_t i = 0; i < n; ++i) directions[i] = uniform_direction(Rng(seed, RngPurpose::test, i).uniform2());
  return directions;
}

// Uniform in [-1, 1]; for large tables.
inline void fill_random(std::span<float> values, std::uint64_t seed) {
  for (std::size_t i = 0; i < values.size(); ++i) {
    values[i] = static_cast<float>(static_cast<std::int32_t>(mix64(seed * 0x9e3779b97f4a7c15ull + i) >> 32)) * 0x1p-31f;
  }
}

}  // namespace octrad::testing
