// Lambertian reflection: reflectance / pi.
#pragma once

#include "octrad/shading/bsdf_types.h"
#include "octrad/shading/square_maps.h"

namespace octrad {

struct DiffuseModel {
  static constexpr bool kDeltaOnly = false;

  OCTRAD_HD static BsdfValue evaluate(const Bsdf& b, Vec3f wo, Vec3f wi) {
    if (!(wo.z > 0.0f && wi.z > 0.0f)) return {};
    const float p = wi.z * kInvPi;
    return {b.reflectance * p, p};
  }
  OCTRAD_HD static BsdfSample sample(const Bsdf& b, Vec3f wo, float, Vec2f u) {
    BsdfSample s;
    if (!(wo.z > 0.0f)) return s;
    s.wi = square_to_cosine_hemisphere(u);
    s.pdf = s.wi.z * kInvPi;
    s.weight = b.reflectance;
    s.valid = s.pdf > 0.0f;
    return s;
  }
  OCTRAD_HD static Vec3f albedo(const Bsdf& b) { return b.reflectance; }
  OCTRAD_HD static float roughness(const Bsdf&) { return 1.0f; }
};

}  // namespace octrad
