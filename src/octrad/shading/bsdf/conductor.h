// Smooth metal: mirror reflection weighted by the Fresnel equations of a complex index.
#pragma once

#include "octrad/shading/bsdf_types.h"
#include "octrad/shading/fresnel.h"

namespace octrad {

struct ConductorModel {
  static constexpr bool kDeltaOnly = true;

  OCTRAD_HD static BsdfValue evaluate(const Bsdf&, Vec3f, Vec3f) { return {}; }
  OCTRAD_HD static BsdfSample sample(const Bsdf& b, Vec3f wo, float, Vec2f) {
    BsdfSample s;
    if (!(wo.z > 0.0f)) return s;
    s.wi = {-wo.x, -wo.y, wo.z};
    s.weight = b.specular_reflectance * fresnel_conductor(wo.z, b.conductor_eta, b.conductor_k);
    s.pdf = 1.0f;
    s.delta = true;
    s.valid = true;
    return s;
  }
  OCTRAD_HD static Vec3f albedo(const Bsdf& b) { return b.specular_reflectance; }
  OCTRAD_HD static float roughness(const Bsdf&) { return 0.0f; }
};

}  // namespace octrad
