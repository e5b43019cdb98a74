// What a camera's ray meets, for host and device: where the scene hides its emitters (Mitsuba's `hide_emitters`), they
// let it pass until it has met another surface, and there is no environment behind them.
#pragma once

#include <cstdint>

#include "octrad/geometry/hit.h"
#include "octrad/geometry/offset_math.h"
#include "octrad/geometry/surface_interaction.h"
#include "octrad/scene/ray.h"

namespace octrad {

// Emitters that a ray passes at most; behind more of them it meets nothing.
inline constexpr std::uint32_t kMostHiddenEmitters = 256;

// `hit`: the nearest of `ray`. Its distance stays that from the ray's origin. `rays` grows by those that were traced.
OCTRAD_HD_OR_HOST
template <typename World>
OCTRAD_HD inline Hit behind_emitters(const World& world, const Ray& ray, Hit hit, int& rays) {
  for (std::uint32_t passed = 0; hit.valid(); ++passed) {
    const SurfaceInteraction surface = world.interact(hit, ray.origin, ray.direction);
    if (surface.emitter < 0) return hit;
    if (passed == kMostHiddenEmitters) break;
    const Vec3f origin = offset_origin(surface.position, surface.geometric_normal, ray.direction);
    const float distance = dot(origin - ray.origin, ray.direction);
    hit = world.intersect(origin, ray.direction, 0.0f, ray.t_max - distance);
    hit.t += distance;
    ++rays;
  }
  return {};
}

// Traces a camera's ray.
OCTRAD_HD_OR_HOST
template <typename World>
OCTRAD_HD inline Hit camera_hit(const World& world, const Ray& ray, int& rays) {
  const Hit hit = world.intersect(ray.origin, ray.direction, 0.0f, ray.t_max);
  ++rays;
  return world.hides_emitters() ? behind_emitters(world, ray, hit, rays) : hit;
}

}  // namespace octrad
