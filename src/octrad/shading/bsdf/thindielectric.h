// A thin pane: both boundaries of a dielectric slab with all reflections between them summed; light goes straight
// through.
#pragma once

#include "octrad/shading/bsdf_types.h"
#include "octrad/shading/fresnel.h"

namespace octrad {

struct ThinDielectricModel {
  static constexpr bool kDeltaOnly = true;

  OCTRAD_HD static BsdfValue evaluate(const Bsdf&, Vec3f, Vec3f) { return {}; }
  OCTRAD_HD static BsdfSample sample(const Bsdf& b, Vec3f wo, float u_lobe, Vec2f) {
    BsdfSample s;
    float r = fresnel_dielectric(std::fabs(wo.z), b.eta).reflectance;
    r *= 2.0f / (1.0f + r);  // r + t r t + t r^3 t + ...
    s.delta = true;
    s.valid = true;
    if (u_lobe <= r) {
      s.wi = {-wo.x, -wo.y, wo.z};
      s.pdf = r;
      s.weight = b.specular_reflectance;
      s.valid = r > 0.0f;
    } else {
      s.wi = -wo;
      s.pdf = 1.0f - r;
      s.weight = b.specular_transmittance;
      s.transmission = true;
    }
    return s;
  }
  OCTRAD_HD static Vec3f albedo(const Bsdf& b) { return b.specular_reflectance; }
  OCTRAD_HD static float roughness(const Bsdf&) { return 0.0f; }
};

}  // namespace octrad
