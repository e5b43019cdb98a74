// Smooth dielectric coat over a diffuse base, with light bouncing between the two summed up (Mitsuba's `plastic`).
// The coat's mirror reflection is a delta lobe.
#pragma once

#include "octrad/shading/bsdf_types.h"
#include "octrad/shading/fresnel.h"
#include "octrad/shading/square_maps.h"

namespace octrad {

// Diffuse reflectance after internal scattering: each channel R / (1 - R r), or / (1 - r) in the linear model.
OCTRAD_HD inline Vec3f base_reflectance(const Bsdf& b) {
  const Vec3f r = b.nonlinear ? b.reflectance * b.internal_reflectance : Vec3f(b.internal_reflectance);
  return b.reflectance / (Vec3f(1.0f) - r);
}

// Probability of sampling the coat's lobe, of which the share `specular` of light is reflected at the coat.
OCTRAD_HD inline float coat_probability(const Bsdf& b, float specular) {
  if (b.lobe != Lobe::all) return b.lobe == Lobe::coat ? 1.0f : 0.0f;
  const float s = specular * (b.specular_reflectance.x + b.specular_reflectance.y + b.specular_reflectance.z);
  const float d = (1.0f - specular) * (b.reflectance.x + b.reflectance.y + b.reflectance.z);
  return s + d > 0.0f ? s / (s + d) : 0.0f;
}

struct PlasticModel {
  static constexpr bool kDeltaOnly = false;

  OCTRAD_HD static BsdfValue evaluate(const Bsdf& b, Vec3f wo, Vec3f wi) {
    if (!(wo.z > 0.0f && wi.z > 0.0f) || b.lobe == Lobe::coat) return {};
    const float fo = fresnel_dielectric(wo.z, b.eta).reflectance, fi = fresnel_dielectric(wi.z, b.eta).reflectance;
    const float p = wi.z * kInvPi;
    return {base_reflectance(b) * (p * (1.0f - fo) * (1.0f - fi) / (b.eta * b.eta)),
            p * (1.0f - coat_probability(b, fo))};
  }
  OCTRAD_HD static BsdfSample sample(const Bsdf& b, Vec3f wo, float u_lobe, Vec2f u) {
    BsdfSample s;
    if (!(wo.z > 0.0f)) return s;
    const float fo = fresnel_dielectric(wo.z, b.eta).reflectance;
    const float q = coat_probability(b, fo);
    if (u_lobe < q) {
      s.wi = {-wo.x, -wo.y, wo.z};
      s.pdf = q;
      s.weight = b.specular_reflectance * (fo / q);
      s.delta = true;
      s.valid = true;
    } else {
      s.wi = square_to_cosine_hemisphere(u);
      s.pdf = (1.0f - q) * s.wi.z * kInvPi;
      const float fi = fresnel_dielectric(s.wi.z, b.eta).reflectance;
      s.valid = s.pdf > 0.0f;
      if (s.valid) s.weight = base_reflectance(b) * ((1.0f - fo) * (1.0f - fi) / (b.eta * b.eta * (1.0f - q)));
    }
    return s;
  }
  OCTRAD_HD static Vec3f albedo(const Bsdf& b) { return b.reflectance; }
  OCTRAD_HD static float reflected(const Bsdf& b, float cos) { return fresnel_dielectric(cos, b.eta).reflectance; }
  OCTRAD_HD static float roughness(const Bsdf& b) { return b.lobe == Lobe::base ? 1.0f : 0.0f; }
};

}  // namespace octrad
