// What octrad selftest launches: each function is one launch over n items on either kind of stream (kernels_device.cc).
// Pointers are to memory of the stream.
#pragma once

#include <cstddef>
#include <cstdint>

#include "octrad/base/vec.h"
#include "octrad/device/stream.h"
#include "octrad/geometry/bvh8_math.h"
#include "octrad/geometry/hit.h"
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
