// Encodings on a device against their definitions.
#pragma once

#include "octrad/device/check.h"
#include "octrad/encoding/lookup_device.h"

namespace octrad {

// Maps of n random directions, against double precision.
CheckResult check_octahedral_map(Stream& stream, std::size_t n, std::uint64_t seed);
CheckResult check_spherical_harmonics(Stream& stream, std::size_t n, std::uint64_t seed);

// Queries at these positions, on the host and in a stream's memory: in random directions, some of them along -z, where
// the octahedral map folds, and with random disparities, a quarter of them 0.
struct LookupQueries {
  std::size_t n;
  std::vector<float> x, w, d;  // [3][n], [3][n], [n]
  DeviceArray<float> device_x, device_w, device_d;
  DeviceQueries view;

  LookupQueries(Stream& stream, std::span<const Vec3f> positions, float largest_disparity, std::uint64_t seed);
  Vec3f position(std::size_t i) const { return {x[i], x[n + i], x[2 * n + i]}; }
  Vec3f direction(std::size_t i) const { return {w[i], w[n + i], w[2 * n + i]}; }
};

// The same with footprints from 2^-9 to 1, a few of them 0; at every seventh nothing is looked up.
struct FootprintQueries {
  std::size_t n;
  std::vector<float> p, r;  // [3][n], [n]
  DeviceArray<float> device_p, device_r;
  DeviceFootprints view;

  FootprintQueries(Stream& stream, std::span<const Vec3f> positions, std::uint64_t seed);
  Vec3f position(std::size_t i) const { return {p[i], p[n + i], p[2 * n + i]}; }
};

// A copy of a table of features in a stream's memory: of floats, or of halves, to which `values` are rounded then.
struct UploadedFeatures {
  DeviceArray<float> floats;
  DeviceArray<Half> halves;

  UploadedFeatures(Stream& stream, std::span<float> values, bool as_halves);
  DeviceFeatures view() const { return {floats.data(), halves.data()}; }
};

// Look-ups of random features, with which the tree or the grid is filled, in tables of floats or halves; both kinds of
// output, whose rows before the first one asked for must stay as they are.
CheckResult check_octree_lookup(Stream& stream, OctaOctree& tree, const LookupQueries& queries, bool halves,
                                std::uint64_t seed);
// The same of a grid over a domain (origin, size) that holds the queries or not.
CheckResult check_hash_grid_lookup(Stream& stream, HashGrid& grid, Vec3f origin, Vec3f size,
                                   const LookupQueries& queries, bool halves, std::uint64_t seed);
// At positions of the unit cube, or outside.
CheckResult check_prefiltered_lookup(Stream& stream, HashGrid& grid, std::span<const Vec3f> p, bool halves,
                                     std::uint64_t seed);

}  // namespace octrad
