// Rough matt surfaces: V-shaped grooves of Lambertian facets with masking and one interreflection (Oren & Nayar 1994,
// "Generalization of Lambert's Reflectance Model", equations 30 to 35), as `roughdiffuse` of Mitsuba 0.6; Mitsuba 3 has
// no such model. alpha_u is the root mean square slope; the angle of the facets deviates by alpha / sqrt(2).
#pragma once

#include "octrad/shading/bsdf_types.h"
#include "octrad/shading/square_maps.h"

namespace octrad {

struct RoughDiffuseModel {
  static constexpr bool kDeltaOnly = false;

  OCTRAD_HD static BsdfValue evaluate(const Bsdf& b, Vec3f wo, Vec3f wi) {
    if (!(wo.z > 0.0f && wi.z > 0.0f)) return {};
    const float s2 = 0.5f * b.alpha_u * b.alpha_u;
    const float zo = wo.z < 1.0f ? wo.z : 1.0f, zi = wi.z < 1.0f ? wi.z : 1.0f;  // unit vectors are rounded
    const float high = zo < zi ? zo : zi, low = zo < zi ? zi : zo;               // cosines of the angles a >= b
    const float sin_a = std::sqrt(1.0f - high * high), sin_b = std::sqrt(1.0f - low * low);
    const float angle_a = std::acos(high), angle_b = std::acos(low);
    const float flat = std::sqrt((wo.x * wo.x + wo.y * wo.y) * (wi.x * wi.x + wi.y * wi.y));
    const float cos_phi = flat > 0.0f ? (wo.x * wi.x + wo.y * wi.y) / flat : 0.0f;
    const float t = 2.0f * kInvPi * angle_b, ab = 4.0f * kInvPi * kInvPi * angle_a * angle_b;
    const float rough = s2 / (s2 + 0.09f);
    const float c1 = 1.0f - 0.5f * s2 / (s2 + 0.33f);
    const float c2 = 0.45f * rough * (cos_phi >= 0.0f ? sin_a : sin_a - t * t * t);
    const float c3 = 0.125f * rough * ab * ab;
    const float tan_mean = (sin_a + sin_b) / (high + low);  // of (a + b) / 2
    const float once = c1 + cos_phi * c2 * (sin_b / low) + (1.0f - std::fabs(cos_phi)) * c3 * tan_mean;
    const float twice = 0.17f * s2 / (s2 + 0.13f) * (1.0f - cos_phi * t * t);
    const float p = wi.z * kInvPi;
    return {b.reflectance * (once * p) + b.reflectance * b.reflectance * (twice * p), p};
  }
  OCTRAD_HD static BsdfSample sample(const Bsdf& b, Vec3f wo, float, Vec2f u) {
    BsdfSample s;
    if (!(wo.z > 0.0f)) return s;
    s.wi = square_to_cosine_hemisphere(u);
    s.weigh(evaluate(b, wo, s.wi));
    return s;
  }
  OCTRAD_HD static Vec3f albedo(const Bsdf& b) { return b.reflectance; }
  OCTRAD_HD static float roughness(const Bsdf&) { return 1.0f; }
};

}  // namespace octrad
