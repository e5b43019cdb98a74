// Light without extent that shines through masks (DeltaLight::through_masks), for host and device. No ray from a BSDF
// can find such a light behind a mask, as it finds those of some extent: shadow rays have to go on.
#pragma once

#include "octrad/geometry/hit.h"
#include "octrad/geometry/offset_math.h"
#include "octrad/shading/light_sample.h"
#include "octrad/shading/shading_point.h"

namespace octrad {

inline constexpr int kMostMasks = 256;  // that a ray passes

// The product of 1 - opacity over the surfaces that a shadow ray meets.
OCTRAD_HD_OR_HOST
template <typename Surfaces>
OCTRAD_HD_APART inline float transmittance_of_masks(Surfaces world, RayQuery ray) {
  float left = 1.0f;
  for (int met = 0; met <= kMostMasks; ++met) {
    const Hit hit = world.intersect(ray.origin, ray.direction, 0.0f, ray.t_max);
    if (!hit.valid()) return left;
    const SurfaceInteraction surface = world.interact(hit, ray.origin, ray.direction);
    left *= 1.0f - world.opacity(surface, -ray.direction);
    if (!(left > 0.0f)) break;
    const Vec3f next = offset_origin(surface.position, surface.geometric_normal, ray.direction);
    ray.t_max -= dot(next - ray.origin, ray.direction);
    ray.origin = next;
  }
  return 0.0f;
}

// The share of a light sample's radiance that masks in front of it leave. Where that was asked for, nothing blocks what
// is left: `ray`, the sample's shadow ray, becomes one that meets nothing. 1 for all other lights, whose ray is yet to
// be cast.
OCTRAD_HD_OR_HOST
template <typename World>
OCTRAD_HD inline float left_by_masks(const World& world, const LightSample& light, RayQuery& ray) {
  if constexpr (World::kModels != Models::plain) {
    if (light.through_masks) {
      const float left = transmittance_of_masks<typename World::Surfaces>(world, ray);
      ray.t_max = 0.0f;
      return left;
    }
  }
  return 1.0f;
}

}  // namespace octrad
