#include "octrad/encoding/cell_index.h"

#include <fmt/core.h>

#include <string>

#include "octrad/base/error.h"
#include "octrad/base/morton.h"

namespace octrad {
namespace {

std::string name(Vec3i c) { return fmt::format("({}, {}, {})", c.x, c.y, c.z); }

}  // namespace

CellIndex::CellIndex(const std::vector<Vec3i>& cells, int resolution, const char* what)
    : resolution_(resolution),
      bricks_per_axis_((resolution + 7) / 8),
      top_(),
      octants_(8) {
  const std::size_t b = static_cast<std::size_t>(bricks_per_axis_);
  top_.assign(b * b * b, 0);
  std::uint64_t previous = 0;
  std::uint32_t count = 0;
  CellOctant* octant = nullptr;  // of the previous cell
  std::uint64_t octant_key = 0;
  for (const Vec3i& c : cells) {
    if (c.x < 0 || c.y < 0 || c.z < 0 || c.x >= resolution || c.y >= resolution || c.z >= resolution) {
      throw InputError(std::string(what) + ": cell " + name(c) + " is outside the grid of " +
                       std::to_string(resolution) + "^3 cells");
    }
    const std::uint64_t key = morton_code(c);
    if (count > 0 && key <= previous) {
      throw InputError(std::string(what) + ": cell " + name(c) +
                       (key == previous ? " occurs twice" : " is not in Morton order"));
    }
    previous = key;
    if (octant == nullptr || key >> 6 != octant_key) {
      std::uint32_t& brick = top_[(static_cast<std::size_t>(c.z >> 3) * b + static_cast<std::size_t>(c.y >> 3)) * b +
                                  static_cast<std::size_t>(c.x >> 3)];
      if (brick == 0) {
        brick = static_cast<std::uint32_t>(octants_.size() / 8);
        octants_.resize(octants_.size() + 8, CellOctant{0, 0, 0});
      }
      octant_key = key >> 6;
      octant = &octants_[std::size_t{brick} * 8 + (octant_key & 7)];
      octant->first = count;
    }
    octant->mask |= std::uint64_t{1} << (key & 63);
    octant->lower += (key & 63) < 32 ? 1 : 0;
    ++count;
  }
}

}  // namespace octrad
