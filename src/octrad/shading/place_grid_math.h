// Places in the world: a box divided into cells, for host and device.
#pragma once

#include "octrad/base/vec.h"

namespace octrad {

// side^3 places in a box of the world; x varies slowest.
struct PlaceGrid {
  Vec3f lower{0, 0, 0}, per_unit{0, 0, 0};
  int side = 1;

  PlaceGrid() = default;
  PlaceGrid(const Bounds3f& box, int side_) : lower(box.lower), side(side_) {
    const auto along = [&](float extent) { return extent > 0.0f ? static_cast<float>(side) / extent : 0.0f; };
    const Vec3f extent = box.upper - box.lower;
    per_unit = {along(extent.x), along(extent.y), along(extent.z)};
  }
  OCTRAD_HD int count() const { return side * side * side; }
  // The place that `p` is in; beyond the box the one at its border.
  OCTRAD_HD int place(Vec3f p) const {
    const Vec3f at = (p - lower) * per_unit;
    const auto along = [last = static_cast<float>(side - 1)](float a) {
      return static_cast<int>(lesser(greater(a, 0.0f), last));
    };
    return (along(at.x) * side + along(at.y)) * side + along(at.z);
  }
};

}  // namespace octrad
