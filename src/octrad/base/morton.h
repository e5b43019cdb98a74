// Order of cells along a Morton curve.
#pragma once

#include <cstdint>

#include "octrad/base/vec.h"

namespace octrad {

// Interleaves the lowest 21 bits of a cell's coordinates (x lowest); cells of one level are ordered by it.
constexpr std::uint64_t morton_code(Vec3i cell) {
  const auto spread = [](int v) {
    std::uint64_t x = static_cast<std::uint64_t>(v) & 0x1fffff;
    x = (x | x << 32) & 0x1f00000000ffffull;
    x = (x | x << 16) & 0x1f0000ff0000ffull;
    x = (x | x << 8) & 0x100f00f00f00f00full;
    x = (x | x << 4) & 0x10c30c30c30c30c3ull;
    return (x | x << 2) & 0x1249249249249249ull;
  };
  return spread(cell.x) | spread(cell.y) << 1 | spread(cell.z) << 2;
}

// The cell of a code.
constexpr Vec3i morton_cell(std::uint64_t code) {
  const auto gather = [](std::uint64_t x) {
    x &= 0x1249249249249249ull;
    x = (x | x >> 2) & 0x10c30c30c30c30c3ull;
    x = (x | x >> 4) & 0x100f00f00f00f00full;
    x = (x | x >> 8) & 0x1f0000ff0000ffull;
    x = (x | x >> 16) & 0x1f00000000ffffull;
    return static_cast<int>((x | x >> 32) & 0x1fffff);
  };
  return {gather(code), gather(code >> 1), gather(code >> 2)};
}

}  // namespace octrad
