// Storage of wavefront kernels: structures of arrays ("planes"), so that accesses of a warp coalesce.
#pragma once

#include <cstddef>
#include <cstdint>

#include "octrad/base/vec.h"
#include "octrad/device/launch.h"
#include "octrad/geometry/hit.h"
#include "octrad/transport/trace_counts.h"

namespace octrad {

// Several floats an item, one array each.
struct FloatPlanes {
  float* data = nullptr;  // [numbers][stride]
  std::size_t stride = 0;

  OCTRAD_HD float get(int number, std::size_t i) const { return data[static_cast<std::size_t>(number) * stride + i]; }
  OCTRAD_HD void set(int number, std::size_t i, float value) const {
    data[static_cast<std::size_t>(number) * stride + i] = value;
  }
  OCTRAD_HD Vec3f get3(int number, std::size_t i) const {
    return {get(number, i), get(number + 1, i), get(number + 2, i)};
  }
  OCTRAD_HD void set3(int number, std::size_t i, Vec3f v) const {
    set(number, i, v.x);
    set(number + 1, i, v.y);
    set(number + 2, i, v.z);
  }
};

// Rays, in planes: origin 0..2, direction 3..5, t_max 6.
inline constexpr int kRayNumbers = 7;

struct RayPlanes : FloatPlanes {
  OCTRAD_HD RayQuery load(std::size_t i) const { return {get3(0, i), get3(3, i), get(6, i)}; }
  OCTRAD_HD void store(std::size_t i, const RayQuery& ray) const {
    set3(0, i, ray.origin);
    set3(3, i, ray.direction);
    set(6, i, ray.t_max);
  }
};

inline constexpr std::uint32_t kNoQuery = 0xffffffffu;

}  // namespace octrad
