// The surface that a point shows along its look-up direction (lookup.reflected, method section 4).
#pragma once

#include <cstddef>

#include "octrad/base/vec.h"

namespace octrad {

// What a point shows along its look-up direction, or one drawn about it (lookup.reflected): the surface that a ray in
// that direction met.
struct ReflectedSurface {
  float met = 0.0f;        // 1: a surface; 0: the ray left the scene, or was not cast
  float alpha = 0.0f;      // its roughness; of a coated surface that of its base, 1
  Vec3f n{0, 0, 0};        // its unit shading normal, on the side of the point
  Vec3f albedo{0, 0, 0};   // of a coated surface: of its base, towards the point
  Vec3f emitted{0, 0, 0};  // radiance that it emits towards the point; without a surface that of the environment
  Vec3f w{0, 0, 0};  // unit direction of the ray where that was drawn (OffsetRay::spread); 0: the look-up direction
};

// What many points show: number c of point i at [c][stride] + i.
struct ReflectedArray {
  float* data = nullptr;  // [kNumbers][stride]
  std::size_t stride = 0;
  static constexpr int kNumbers = 14, kDirectionNumber = 11;

  OCTRAD_HD ReflectedSurface get(std::size_t i) const {
    const auto at = [&](int number) { return data[static_cast<std::size_t>(number) * stride + i]; };
    return {at(0), at(1), {at(2), at(3), at(4)}, {at(5), at(6), at(7)}, {at(8), at(9), at(10)}, direction(i)};
  }
  OCTRAD_HD void set(std::size_t i, const ReflectedSurface& r) const {
    const float numbers[kNumbers] = {r.met,      r.alpha,     r.n.x,       r.n.y,       r.n.z, r.albedo.x, r.albedo.y,
                                     r.albedo.z, r.emitted.x, r.emitted.y, r.emitted.z, r.w.x, r.w.y,      r.w.z};
    OCTRAD_UNROLL
    for (int n = 0; n < kNumbers; ++n) data[static_cast<std::size_t>(n) * stride + i] = numbers[n];
  }
  OCTRAD_HD Vec3f direction(std::size_t i) const {
    const float* at = data + kDirectionNumber * stride + i;
    return {at[0], at[stride], at[2 * stride]};
  }
  OCTRAD_HD void set_direction(std::size_t i, Vec3f w) const {
    float* at = data + kDirectionNumber * stride + i;
    at[0] = w.x;
    at[stride] = w.y;
    at[2 * stride] = w.z;
  }
};

}  // namespace octrad
