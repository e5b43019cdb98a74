// Which cells of a level exist, and where their data lies: 8^3 bricks of occupancy bits with running counts under a dense
// grid of brick numbers. A look-up is three dependent loads; a paper-size scene (2.9 M cells) takes about 6 MB.
//
// Cells are numbered in Morton order (x lowest bit), so a brick's cells are consecutive and so are those of each of its
// eight 4^3 octants: a number is the octant's first number plus the set bits below the cell's own.
#pragma once

#include <cstdint>
#include <vector>

#include "base/hd.h"
#include "base/vec.h"

namespace octrad {

struct CellOctant {
  std::uint64_t mask;      // occupied cells of a 4^3 block, in Morton order
  std::uint32_t first;     // number of its first cell
  std::uint32_t unused;
};
static_assert(sizeof(CellOctant) == 16);

OCTRAD_HD inline int count_bits(std::uint64_t bits) {
#if defined(__CUDA_ARCH__)
  return __popcll(bits);
#else
  return __builtin_popcountll(bits);
#endif
}

// Position of a cell inside its brick, in Morton order: bits 0..2 of each coordinate interleaved.
OCTRAD_HD constexpr int brick_spread(int a) { return (a & 1) | (a & 2) << 2 | (a & 4) << 4; }

// What a device needs; plain pointers into a CellIndex.
struct CellIndexView {
  const std::uint32_t* top = nullptr;       // [bricks_per_axis^3], z slowest; 0: the empty brick
  const CellOctant* octants = nullptr;      // [bricks][8]; brick 0 is empty
  int resolution = 0;                       // cells per axis
  int bricks_per_axis = 0;

  // Number of the cell, or -1 when it is empty or outside the grid.
  OCTRAD_HD std::int64_t find(int x, int y, int z) const {
    if (x < 0 || y < 0 || z < 0 || x >= resolution || y >= resolution || z >= resolution) return -1;
    const std::uint32_t brick = top[((z >> 3) * bricks_per_axis + (y >> 3)) * bricks_per_axis + (x >> 3)];
    const int inner = brick_spread(x) | brick_spread(y) << 1 | brick_spread(z) << 2;
    const CellOctant& octant = octants[static_cast<std::uint64_t>(brick) * 8 + static_cast<std::uint64_t>(inner >> 6)];
    const std::uint64_t bit = std::uint64_t{1} << (inner & 63);
    if ((octant.mask & bit) == 0) return -1;
    return static_cast<std::int64_t>(octant.first) + count_bits(octant.mask & (bit - 1));
  }
};

// Morton key of a cell: bits of x, y, z interleaved, x lowest.
constexpr std::uint64_t morton_key(Vec3i cell) {
  std::uint64_t key = 0;
  for (int b = 0; b < 21; ++b) {
    key |= static_cast<std::uint64_t>((cell.x >> b) & 1) << (3 * b) | static_cast<std::uint64_t>((cell.y >> b) & 1) << (3 * b + 1) |
           static_cast<std::uint64_t>((cell.z >> b) & 1) << (3 * b + 2);
  }
  return key;
}

class CellIndex {
 public:
  // cells: occupied cells of a grid of resolution^3 in Morton order, each once. Throws InputError otherwise, naming the
  // cell; `what` names the level in the message.
  CellIndex(const std::vector<Vec3i>& cells, int resolution, const char* what);
  CellIndexView view() const { return {top_.data(), octants_.data(), resolution_, bricks_per_axis_}; }
  std::size_t bytes() const { return top_.size() * sizeof(std::uint32_t) + octants_.size() * sizeof(CellOctant); }

 private:
  int resolution_, bricks_per_axis_;
  std::vector<std::uint32_t> top_;
  std::vector<CellOctant> octants_;
};

}  // namespace octrad
