// Which cells of a level exist, and where their data lies: 8^3 bricks of occupancy bits with running counts under a
// dense grid of brick numbers. A look-up is three dependent loads; a paper-size scene (2.9 M cells) takes about 6 MB.
//
// Cells are numbered in Morton order (x lowest bit), so a brick's cells are consecutive and so are those of each of its
// eight 4^3 octants: a number is the octant's first number plus the set bits below the cell's own.
#pragma once

#include <cstdint>
#include <vector>

#include "octrad/base/bits.h"
#include "octrad/base/hd.h"
#include "octrad/base/vec.h"

namespace octrad {

struct alignas(16) CellOctant {
  std::uint64_t mask;   // occupied cells of a 4^3 block, in Morton order
  std::uint32_t first;  // number of its first cell
  std::uint32_t lower;  // how many are in the lower half of the mask
};
static_assert(sizeof(CellOctant) == 16);

// Position of a cell inside its brick, in Morton order: bits 0..2 of each coordinate interleaved.
OCTRAD_HD constexpr int brick_spread(int a) { return (a & 1) | (a & 2) << 2 | (a & 4) << 4; }

inline constexpr std::uint32_t kNoCell = 0xffffffffu;

// The part of a cell's address that one coordinate gives; those of x, y and z are added.
struct CellPlace {
  std::uint32_t brick, inner;
  OCTRAD_HD CellPlace operator+(CellPlace b) const { return {brick + b.brick, inner | b.inner}; }
};

// What a device needs; plain pointers into a CellIndex.
struct CellIndexView {
  const std::uint32_t* top = nullptr;   // [bricks_per_axis^3], z slowest; 0: the empty brick
  const CellOctant* octants = nullptr;  // [bricks][8]; brick 0 is empty
  int resolution = 0;                   // cells per axis
  int bricks_per_axis = 0;

  // Part of coordinate `a` in [0, resolution) along an axis.
  OCTRAD_HD CellPlace place(int axis, int a) const {
    const int stride = axis == 0 ? 1 : (axis == 1 ? bricks_per_axis : bricks_per_axis * bricks_per_axis);
    return {static_cast<std::uint32_t>((a >> 3) * stride), static_cast<std::uint32_t>(brick_spread(a) << axis)};
  }
  // Number of the cell, or kNoCell where it is empty.
  OCTRAD_HD std::uint32_t number(CellPlace place) const {
    const CellOctant* octant = octants + (top[place.brick] * std::size_t{8} + (place.inner >> 6));
    const bool upper = (place.inner & 32u) != 0;
#if defined(__CUDA_ARCH__)
    // One load: the compiler makes two of the struct.
    const uint4 words = __ldg(reinterpret_cast<const uint4*>(octant));
    const std::uint32_t mask = upper ? words.y : words.x, first = words.z + (upper ? words.w : 0u);
#else
    const auto mask = static_cast<std::uint32_t>(upper ? octant->mask >> 32 : octant->mask);
    const std::uint32_t first = octant->first + (upper ? octant->lower : 0u);
#endif
    const std::uint32_t bit = 1u << (place.inner & 31u), number = first + count_bits(mask & (bit - 1u));
    return (mask & bit) != 0 ? number : kNoCell;
  }
  // The same for any coordinates: kNoCell outside the grid.
  OCTRAD_HD std::uint32_t find(int x, int y, int z) const {
    if (x < 0 || y < 0 || z < 0 || x >= resolution || y >= resolution || z >= resolution) return kNoCell;
    return number(place(0, x) + place(1, y) + place(2, z));
  }
};

class CellIndex {
 public:
  // cells: occupied cells of a grid of resolution^3 in Morton order, each once. Throws InputError otherwise, naming the
  // cell; `what` names the level in the message.
  CellIndex(const std::vector<Vec3i>& cells, int resolution, const char* what);
  CellIndexView view() const { return {top_.data(), octants_.data(), resolution_, bricks_per_axis_}; }

 private:
  int resolution_, bricks_per_axis_;
  std::vector<std::uint32_t> top_;
  std::vector<CellOctant> octants_;
};

}  // namespace octrad
