// Rough dielectric coat over a diffuse base (Mitsuba's `roughplastic`): a microfacet lobe, and a base lit and seen
// through the coat's directional transmittance, which Materials tabulates (shading/rough_transmittance.h).
#pragma once

#include "octrad/shading/bsdf/plastic.h"
#include "octrad/shading/microfacet.h"

namespace octrad {

struct RoughPlasticModel {
  static constexpr bool kDeltaOnly = false;

  // Transmittance of the coat from outside, linear between table entries.
  OCTRAD_HD static float transmittance(const Bsdf& b, float cos) {
    const float x = cos * static_cast<float>(kTransmittanceResolution - 1);
    int i = static_cast<int>(x);
    if (i > kTransmittanceResolution - 2) i = kTransmittanceResolution - 2;
    const float f = x - static_cast<float>(i);
    return b.external_transmittance[i] * (1.0f - f) + b.external_transmittance[i + 1] * f;
  }
  OCTRAD_HD static Microfacet microfacet(const Bsdf& b) {
    return {b.distribution, b.alpha_u, b.alpha_u, b.sample_visible};
  }
  OCTRAD_HD static BsdfValue evaluate(const Bsdf& b, Vec3f wo, Vec3f wi) {
    if (!(wo.z > 0.0f && wi.z > 0.0f)) return {};
    const Microfacet m = microfacet(b);
    const Vec3f h = normalize(wo + wi);
    const float cos_h = dot(wo, h);
    const float d = m.density(h), g_o = m.masking(wo, h), g_i = m.masking(wi, h);
    const float t_o = transmittance(b, wo.z), t_i = transmittance(b, wi.z);
    const float specular = fresnel_dielectric(cos_h, b.eta).reflectance * d * g_o * g_i / (4.0f * wo.z);
    const float p_specular = m.visible ? d * g_o / (4.0f * wo.z) : d * h.z / (4.0f * dot(wi, h));
    const float q = coat_probability(b, 1.0f - t_o);
    const float p_diffuse = wi.z * kInvPi;
    BsdfValue v;
    if (b.lobe != Lobe::base) v.value += b.specular_reflectance * specular;
    if (b.lobe != Lobe::coat) v.value += base_reflectance(b) * (p_diffuse * t_o * t_i / (b.eta * b.eta));
    v.pdf = q * p_specular + (1.0f - q) * p_diffuse;
    return v;
  }
  OCTRAD_HD static BsdfSample sample(const Bsdf& b, Vec3f wo, float u_lobe, Vec2f u) {
    BsdfSample s;
    if (!(wo.z > 0.0f)) return s;
    const float q = coat_probability(b, 1.0f - transmittance(b, wo.z));
    s.wi = u_lobe < q ? reflect(wo, microfacet(b).sample_normal(wo, u)) : square_to_cosine_hemisphere(u);
    s.weigh(evaluate(b, wo, s.wi));
    return s;
  }
  OCTRAD_HD static Vec3f albedo(const Bsdf& b) { return b.reflectance; }
  OCTRAD_HD static float reflected(const Bsdf& b, float cos) { return 1.0f - transmittance(b, cos); }
  OCTRAD_HD static float roughness(const Bsdf& b) {
    return b.lobe == Lobe::base ? 1.0f : std::fmin(b.alpha_u, kRoughestLobe);
  }
};

}  // namespace octrad
