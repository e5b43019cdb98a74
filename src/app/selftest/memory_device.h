// Kernels of micro-benchmarks: what memory and launches cost. One launch over n items each, on either kind of stream.
#pragma once

#include <cstddef>
#include <cstdint>

#include "octrad/device/stream.h"

namespace octrad::selftest {

// A sector of memory, what a GPU reads at least.
struct alignas(32) Sector {
  float values[8];
};

// kAccesses places of a table of mask + 1 entries (a power of two) for each item, at random.
inline constexpr int kAccesses = 8;
void run_sector_reads(Stream& stream, std::size_t n, const Sector* table, std::uint32_t mask, float* out);
void run_gathers(Stream& stream, std::size_t n, const float* table, std::uint32_t mask, float* out);
void run_scatter(Stream& stream, std::size_t n, float* table, std::uint32_t mask);   // adds 1
void run_scatter4(Stream& stream, std::size_t n, float* table, std::uint32_t mask);  // entries of four floats, each + 1
void run_nothing(Stream& stream);

}  // namespace octrad::selftest
