// A point drawn on an emitter, and the shadow ray towards it. For host and device.
#pragma once

#include "octrad/geometry/hit.h"
#include "octrad/geometry/offset_math.h"

namespace octrad {

struct LightSample {
  Vec3f direction;        // unit, from the reference point to the light
  float distance = 0.0f;  // to the sampled point (kEnvironmentDistance for the environment)
  Vec3f radiance;         // emitted towards the reference point
  float pdf = 0.0f;       // solid angle at the reference point, times the probability of picking the light
  bool valid = false;
  bool delta = false;          // of a light without extent: no ray from a BSDF finds it
  bool through_masks = false;  // DeltaLight::through_masks
};

// What the sample's contribution is divided by: the balance heuristic of its density and of the BSDF's for the same
// direction (Veach & Guibas 1995).
OCTRAD_HD inline float light_mis_density(const LightSample& light, float bsdf_pdf) {
  return light.pdf + (light.delta ? 0.0f : bsdf_pdf);
}

inline constexpr float kEnvironmentDistance = 1e30f;

// Shadow rays end this share of the distance before the light (Mitsuba's shadow epsilon).
inline constexpr float kShadowShortening = 1.0f - 15000.0f * 0x1p-24f;

// A ray from just off a surface to just before the sampled point. It aims at the point itself: keeping the sample's
// direction from the shifted origin would end behind lights that are close.
OCTRAD_HD inline RayQuery shadow_ray(Vec3f position, Vec3f geometric_normal, const LightSample& sample) {
  const Vec3f origin = offset_origin(position, geometric_normal, sample.direction);
  if (sample.distance >= kEnvironmentDistance) return {origin, sample.direction, sample.distance};
  const Vec3f d = position - origin + sample.direction * sample.distance;
  const float l = length(d);
  return {origin, l > 0.0f ? d / l : sample.direction, l * kShadowShortening};
}

}  // namespace octrad
