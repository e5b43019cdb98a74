// Rough metal: microfacet reflection (Walter et al. 2007) with the Fresnel equations of a complex index; anisotropic
// along the frame's s (alpha_u) and t (alpha_v).
#pragma once

#include "octrad/shading/bsdf_types.h"
#include "octrad/shading/fresnel.h"
#include "octrad/shading/microfacet.h"

namespace octrad {

struct RoughConductorModel {
  static constexpr bool kDeltaOnly = false;

  OCTRAD_HD static Microfacet microfacet(const Bsdf& b) {
    return {b.distribution, b.alpha_u, b.alpha_v, b.sample_visible};
  }
  OCTRAD_HD static BsdfValue evaluate(const Bsdf& b, Vec3f wo, Vec3f wi) {
    if (!(wo.z > 0.0f && wi.z > 0.0f)) return {};
    const Microfacet m = microfacet(b);
    const Vec3f h = normalize(wo + wi);
    const float cos_h = dot(wo, h);
    const float d = m.density(h);
    if (d == 0.0f || cos_h <= 0.0f) return {};
    const float g_o = m.masking(wo, h), g_i = m.masking(wi, h);
    const Vec3f f = fresnel_conductor(cos_h, b.conductor_eta, b.conductor_k) * b.specular_reflectance;
    const float p = m.visible ? d * g_o / (4.0f * wo.z) : d * h.z / (4.0f * cos_h);
    return {f * (d * g_o * g_i / (4.0f * wo.z)), p};
  }
  OCTRAD_HD static BsdfSample sample(const Bsdf& b, Vec3f wo, float, Vec2f u) {
    BsdfSample s;
    if (!(wo.z > 0.0f)) return s;
    const Microfacet m = microfacet(b);
    const Vec3f h = m.sample_normal(wo, u);
    s.wi = reflect(wo, h);
    const float cos_h = dot(wo, h);
    if (!(s.wi.z > 0.0f && cos_h > 0.0f)) return s;
    const float d = m.density(h), g_o = m.masking(wo, h), g_i = m.masking(s.wi, h);
    s.pdf = m.visible ? d * g_o / (4.0f * wo.z) : d * h.z / (4.0f * cos_h);
    if (!(s.pdf > 0.0f)) return s;
    const float weight = m.visible ? g_i : g_o * g_i * cos_h / (wo.z * h.z);
    s.weight = fresnel_conductor(cos_h, b.conductor_eta, b.conductor_k) * b.specular_reflectance * weight;
    s.valid = true;
    return s;
  }
  OCTRAD_HD static Vec3f albedo(const Bsdf& b) { return b.specular_reflectance; }
  OCTRAD_HD static float roughness(const Bsdf& b) { return std::fmin(std::sqrt(b.alpha_u * b.alpha_v), kRoughestLobe); }
};

}  // namespace octrad
