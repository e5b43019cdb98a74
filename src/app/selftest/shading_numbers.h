// What a World (the CPU's classes, or DeviceWorld) says about the end of a ray, as numbers to compare.
#pragma once

#include "octrad/base/vec.h"
#include "octrad/geometry/hit.h"

namespace octrad::selftest {

inline constexpr int kShadingNumbers = 24;

#if defined(__CUDACC__)
#pragma nv_exec_check_disable
#endif
template <typename World>
OCTRAD_HD void shading_numbers(const World& world, const Hit& hit, Vec3f origin, Vec3f direction, const float* u,
                               float* out) {
  for (int k = 0; k < kShadingNumbers; ++k) out[k] = 0.0f;
  const auto put = [&](int at, Vec3f v) {
    for (int a = 0; a < 3; ++a) out[at + a] = v[a];
  };
  if (!hit.valid()) {
    put(0, world.environment(direction));
    return;
  }
  const auto surface = world.interact(hit, origin, direction);
  const auto point = world.shade(surface, -direction);
  put(0, world.emitted(surface, -direction));
  put(3, point.ns);
  put(6, albedo_bsdf(point.bsdf));
  out[9] = roughness_bsdf(point.bsdf);
  const auto light = world.sample_light(surface.position, u[0], {u[1], u[2]});
  if (light.valid) {
    put(10, light.direction);
    put(13, light.radiance);
    const auto f = evaluate_bsdf(point.bsdf, point.to_local(point.wo), point.to_local(light.direction));
    put(16, f.value);
  }
  const auto s = sample_bsdf(point.bsdf, point.to_local(point.wo), u[3], {u[4], u[5]});
  if (s.valid) {
    put(19, s.weight);
    out[22] = s.wi.z;
  }
  out[23] = light.valid ? 1.0f : 0.0f;
}

}  // namespace octrad::selftest
