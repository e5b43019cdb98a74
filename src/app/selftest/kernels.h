// What octrad selftest launches: each function is one launch over n items on either kind of stream (kernels_device.cc).
// Pointers are to memory of the stream.
#pragma once

#include <cstddef>
#include <cstdint>

#include "octrad/base/vec.h"
#include "octrad/device/rows.h"
#include "octrad/device/stream.h"
#include "octrad/encoding/hash_grid_math.h"
#include "octrad/geometry/bvh8_math.h"
#include "octrad/geometry/hit.h"
#include "octrad/network/adam.h"
#include "octrad/network/adam_math.h"
#include "octrad/shading/device_world.h"

namespace octrad::selftest {

// A ray as the stream reads it: 32 bytes.
struct alignas(16) DeviceRay {
  Vec3f origin;
  float t_max;
  Vec3f direction;
  float unused;
};

// A sector of memory, what a GPU reads at least.
struct alignas(32) Sector {
  float values[8];
};

// Definitions, evaluated one item each.
void run_rng(Stream& stream, std::size_t n, std::uint64_t seed, std::uint32_t* out);               // [n]
void run_sobol(Stream& stream, std::size_t n, std::uint32_t* out);                                 // [n, 3]
void run_octahedral(Stream& stream, std::size_t n, const Vec3f* directions, Vec2f* out);           // [n]
void run_spherical_harmonics(Stream& stream, std::size_t n, const Vec3f* directions, float* out);  // [n, 16]
void run_hash_grid(Stream& stream, std::size_t n, const HashGridView& grid, const Vec3f* positions,
                   float* out);  // [n, levels]: feature 0
void run_adam(Stream& stream, std::size_t n, const AdamConstants& constants, float rate, float second,
              const float* gradients, float* parameters, float* m, float* v);

// Tap i, in slot i, to the gradient of a table of kTapFeatures features an entry: scale times
// upstream[source][feature].
inline constexpr int kTapFeatures = 4;
void run_taps(Stream& stream, std::size_t n, const SparseTap* taps, const float* upstream, const AddNow& sink);
void run_taps(Stream& stream, std::size_t n, const SparseTap* taps, const float* upstream, const KeepForSort& sink);

// counts[values[i] mod 8] += 1, *sum += 1, *flags |= 1 << values[i] mod 8
void run_atomics(Stream& stream, std::size_t n, const std::uint32_t* values, std::uint32_t* counts, float* sum,
                 std::uint32_t* flags);

// Rays from 0 to t_max.
void run_closest(Stream& stream, std::size_t n, const Bvh8View& bvh, const DeviceRay* rays, Hit* hits);
void run_occluded(Stream& stream, std::size_t n, const Bvh8View& bvh, const DeviceRay* rays, std::uint32_t* blocked);

// The same by bvh8_intersect() and bvh8_occluded(), a thread for each ray.
void run_closest_alone(Stream& stream, std::size_t n, const Bvh8View& bvh, const DeviceRay* rays, Hit* hits);
void run_occluded_alone(Stream& stream, std::size_t n, const Bvh8View& bvh, const DeviceRay* rays,
                        std::uint32_t* blocked);

// shading_numbers() of each ray at its hit; u: six numbers a ray, out: kShadingNumbers a ray.
void run_shading(Stream& stream, std::size_t n, const DeviceWorld& world, const DeviceRay* rays, const Hit* hits,
                 const float* u, float* out);

// Memory: kAccesses places of a table of mask + 1 entries (a power of two) for each item, at random.
inline constexpr int kAccesses = 8;
void run_sector_reads(Stream& stream, std::size_t n, const Sector* table, std::uint32_t mask, float* out);
void run_gathers(Stream& stream, std::size_t n, const float* table, std::uint32_t mask, float* out);
void run_scatter(Stream& stream, std::size_t n, float* table, std::uint32_t mask);   // adds 1
void run_scatter4(Stream& stream, std::size_t n, float* table, std::uint32_t mask);  // entries of four floats, each + 1
void run_nothing(Stream& stream);

}  // namespace octrad::selftest
