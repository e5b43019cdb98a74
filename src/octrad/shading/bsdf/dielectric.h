// Smooth boundary between two dielectrics: mirror reflection and refraction. Radiance is scaled by the squared index
// ratio at refraction.
#pragma once

#include "octrad/shading/bsdf_types.h"
#include "octrad/shading/fresnel.h"

namespace octrad {

struct DielectricModel {
  static constexpr bool kDeltaOnly = true;

  OCTRAD_HD static BsdfValue evaluate(const Bsdf&, Vec3f, Vec3f) { return {}; }
  OCTRAD_HD static BsdfSample sample(const Bsdf& b, Vec3f wo, float u_lobe, Vec2f) {
    BsdfSample s;
    const DielectricFresnel f = fresnel_dielectric(wo.z, b.eta);
    s.delta = true;
    if (u_lobe <= f.reflectance) {
      s.wi = {-wo.x, -wo.y, wo.z};
      s.pdf = f.reflectance;
      s.weight = b.specular_reflectance;
      s.valid = f.reflectance > 0.0f;
    } else {
      s.wi = {-f.eta_ti * wo.x, -f.eta_ti * wo.y, f.cos_transmitted};
      s.pdf = 1.0f - f.reflectance;
      s.weight = b.specular_transmittance * (f.eta_ti * f.eta_ti);
      s.eta = f.eta_it;
      s.transmission = true;
      s.valid = true;
    }
    return s;
  }
  OCTRAD_HD static Vec3f albedo(const Bsdf& b) { return b.specular_reflectance; }
  OCTRAD_HD static float roughness(const Bsdf&) { return 0.0f; }
};

}  // namespace octrad
