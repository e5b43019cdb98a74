// Cloth that is dark seen from the front and bright towards its rim: a diffuse model times 1 - fuzz cos cos. Template
// of docs/extending.md.
#pragma once

#include "octrad/shading/bsdf_types.h"
#include "octrad/shading/square_maps.h"

namespace octrad {

struct VelvetModel {
  static constexpr bool kDeltaOnly = false;

  OCTRAD_HD static float pile(const Bsdf& b, Vec3f wo, Vec3f wi) { return 1.0f - b.fuzz * wo.z * wi.z; }
  OCTRAD_HD static BsdfValue evaluate(const Bsdf& b, Vec3f wo, Vec3f wi) {
    if (!(wo.z > 0.0f && wi.z > 0.0f)) return {};
    const float p = wi.z * kInvPi;
    return {b.reflectance * (p * pile(b, wo, wi)), p};
  }
  OCTRAD_HD static BsdfSample sample(const Bsdf& b, Vec3f wo, float, Vec2f u) {
    BsdfSample s;
    if (!(wo.z > 0.0f)) return s;
    s.wi = square_to_cosine_hemisphere(u);
    s.pdf = s.wi.z * kInvPi;
    s.weight = b.reflectance * pile(b, wo, s.wi);
    s.valid = s.pdf > 0.0f;
    return s;
  }
  OCTRAD_HD static Vec3f albedo(const Bsdf& b) { return b.reflectance; }
  OCTRAD_HD static float roughness(const Bsdf&) { return 1.0f; }
};

}  // namespace octrad
