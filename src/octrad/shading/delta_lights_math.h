// Sampling of lights without extent, as Mitsuba 3's point, spot, directional and projector: for host and device.
#pragma once

#include <cmath>

#include "octrad/scene/delta_light.h"
#include "octrad/scene/texture_math.h"
#include "octrad/shading/light_sample.h"

namespace octrad {

namespace lights_detail {

OCTRAD_HD inline Vec3f rotate_to_local(const DeltaLight& l, Vec3f d) {
  const float* m = l.to_local;
  return {m[0] * d.x + m[1] * d.y + m[2] * d.z, m[4] * d.x + m[5] * d.y + m[6] * d.z,
          m[8] * d.x + m[9] * d.y + m[10] * d.z};
}

// Where a line through the light, along `local`, meets its picture: [0, 1]^2 inside.
OCTRAD_HD inline Vec2f picture_position(const DeltaLight& l, Vec3f local, float sign) {
  return {0.5f + sign * 0.5f * local.x / (local.z * l.tan_x), 0.5f + sign * 0.5f * local.y / (local.z * l.tan_y)};
}

// Share of the intensity that a spot light sends along `local`, unit.
OCTRAD_HD inline float spot_falloff(const DeltaLight& l, Vec3f local) {
  if (!(local.z > l.cos_cutoff)) return 0.0f;
  return local.z >= l.cos_beam ? 1.0f : (l.cutoff - std::acos(local.z)) * l.inverse_transition;
}

// Irradiance of a surface that faces a spot or a projector, from where the light lies `d` away.
OCTRAD_HD_APART inline Vec3f aimed_radiance(const DeltaLight& l, const TextureView* textures, Vec3f d) {
  const float distance2 = dot(d, d);
  Vec3f local = rotate_to_local(l, -d), radiance(0.0f);
  const bool spot = l.kind == DeltaLight::Kind::spot;
  if (spot) {
    local = normalize(local);
    radiance = l.intensity * (spot_falloff(l, local) / distance2);
    if (!(max_component(radiance) > 0.0f)) return Vec3f(0.0f);
  }
  const Vec2f uv = picture_position(l, local, spot ? 1.0f : -1.0f);
  if (!spot) {
    if (!(local.z > 0.0f) || !(uv.x >= 0.0f && uv.x <= 1.0f && uv.y >= 0.0f && uv.y <= 1.0f)) return Vec3f(0.0f);
    radiance = l.intensity * (-std::sqrt(distance2) / (local.z * local.z * dot(l.axis, d)));
  }
  return l.texture >= 0 ? radiance * evaluate_texture(textures[l.texture], uv) : radiance;
}

}  // namespace lights_detail

// The light's only direction at `x`: density `pick` and the irradiance of a surface facing the light as radiance.
OCTRAD_HD inline LightSample sample_delta_light(const DeltaLight& l, const TextureView* textures, float pick, Vec3f x) {
  LightSample s;
  s.delta = true;
  s.through_masks = l.through_masks;
  s.pdf = pick;
  if (l.kind == DeltaLight::Kind::directional) {
    s.direction = -l.axis;
    s.distance = kEnvironmentDistance;
    s.radiance = l.intensity;
  } else {
    const Vec3f d = l.position - x;
    const float distance2 = dot(d, d);
    s.distance = std::sqrt(distance2);
    s.direction = d / s.distance;
    s.radiance =
        l.kind == DeltaLight::Kind::point ? l.intensity / distance2 : lights_detail::aimed_radiance(l, textures, d);
  }
  s.valid = s.distance > 0.0f && max_component(s.radiance) > 0.0f && is_finite(s.radiance);
  return s;
}

}  // namespace octrad
