// Rough boundary between two dielectrics: microfacets that reflect and refract (Walter et al. 2007), anisotropic along
// the frame's s (alpha_u) and t (alpha_v). Radiance is scaled by the squared index ratio at refraction. Lobe::coat is
// the reflection alone, Lobe::base the transmission.
#pragma once

#include "octrad/shading/bsdf_types.h"
#include "octrad/shading/fresnel.h"
#include "octrad/shading/microfacet.h"

namespace octrad {

// Density D cos of microfacet normals with which `m` is drawn for a viewer in `wo` on either side.
OCTRAD_HD inline float microfacet_pdf(const Microfacet& distribution, float d, Vec3f wo, Vec3f m) {
  return distribution.visible ? d * distribution.masking(wo, m) * std::fabs(dot(wo, m) / wo.z) : d * m.z;
}

// Half vector of reflection or of refraction with the relative index `eta` from wo's side to wi's, on the side of +z.
OCTRAD_HD inline Vec3f half_vector(Vec3f wo, Vec3f wi, float eta) {
  const Vec3f h = normalize(wo + wi * eta);
  return h.z < 0.0f ? -h : h;
}

// |d half vector / d wi| of refraction.
OCTRAD_HD inline float refraction_jacobian(float cos_o, float cos_i, float eta) {
  const float d = cos_o + eta * cos_i;
  return std::fabs(eta * eta * cos_i / (d * d));
}

struct RoughDielectricModel {
  static constexpr bool kDeltaOnly = false;

  OCTRAD_HD static Microfacet microfacet(const Bsdf& b, float scale = 1.0f) {
    return {b.distribution, b.alpha_u * scale, b.alpha_v * scale, b.sample_visible};
  }
  // What normals are drawn from: where all are drawn, a wider distribution keeps weights small (Walter et al. 2007).
  OCTRAD_HD static Microfacet sampled(const Bsdf& b, Vec3f wo) {
    return microfacet(b, b.sample_visible ? 1.0f : 1.2f - 0.2f * std::sqrt(std::fabs(wo.z)));
  }
  // Light scattered from wi to wo by facets of normal `h`.
  OCTRAD_HD static BsdfValue facets(const Bsdf& b, Vec3f wo, Vec3f wi, Vec3f h) {
    const bool reflects = wo.z * wi.z > 0.0f;
    const float cos_o = dot(wo, h), cos_i = dot(wi, h);
    if (!(cos_o * wo.z > 0.0f && cos_i * wi.z > 0.0f) || b.lobe == (reflects ? Lobe::base : Lobe::coat)) return {};
    const Microfacet m = microfacet(b), from = sampled(b, wo);
    const float d = m.density(h);
    const float f = fresnel_dielectric(cos_o, b.eta).reflectance;
    const float share = reflects ? f : 1.0f - f;
    const float eta = wo.z > 0.0f ? b.eta : 1.0f / b.eta;
    const float jacobian = reflects ? 1.0f / std::fabs(4.0f * cos_i) : refraction_jacobian(cos_o, cos_i, eta);
    // Radiance is divided by eta^2 where it is refracted.
    const float scale = reflects ? 1.0f : 1.0f / (eta * eta);
    const float value = scale * share * d * m.masking(wo, h) * m.masking(wi, h) * std::fabs(cos_o / wo.z) * jacobian;
    const float pdf = microfacet_pdf(from, b.sample_visible ? d : from.density(h), wo, h) * jacobian;
    return {(reflects ? b.specular_reflectance : b.specular_transmittance) * value,
            b.lobe == Lobe::all ? pdf * share : pdf};
  }
  OCTRAD_HD static BsdfValue evaluate(const Bsdf& b, Vec3f wo, Vec3f wi) {
    if (wo.z == 0.0f || wi.z == 0.0f) return {};
    const float eta = wo.z * wi.z > 0.0f ? 1.0f : (wo.z > 0.0f ? b.eta : 1.0f / b.eta);
    return facets(b, wo, wi, half_vector(wo, wi, eta));
  }
  OCTRAD_HD static BsdfSample sample(const Bsdf& b, Vec3f wo, float u_lobe, Vec2f u) {
    BsdfSample s;
    if (wo.z == 0.0f) return s;
    const Vec3f h = sampled(b, wo).sample_normal(wo.z > 0.0f ? wo : -wo, u);
    const DielectricFresnel f = fresnel_dielectric(dot(wo, h), b.eta);
    const bool reflects = b.lobe == Lobe::all ? u_lobe <= f.reflectance : b.lobe == Lobe::coat;
    s.wi = reflects ? reflect(wo, h) : refract(wo, h, f.cos_transmitted, f.eta_ti);
    if (!(reflects ? s.wi.z * wo.z > 0.0f : s.wi.z * wo.z < 0.0f && f.reflectance < 1.0f)) return s;
    s.weigh(facets(b, wo, s.wi, h));
    s.transmission = !reflects;
    if (!reflects) s.eta = f.eta_it;
    return s;
  }
  // What is reflected and what is let in of light that comes alike from everywhere outside.
  OCTRAD_HD static Vec3f albedo(const Bsdf& b) {
    const float f = fresnel_diffuse_reflectance(b.eta);
    return b.specular_reflectance * f + b.specular_transmittance * (1.0f - f);
  }
  OCTRAD_HD static float roughness(const Bsdf& b) { return std::fmin(std::sqrt(b.alpha_u * b.alpha_v), kRoughestLobe); }

  // Share of light that a flat boundary reflects, kept within bounds: microfacets blur the critical angle.
  OCTRAD_HD static float reflected(const Bsdf& b, float cos) {
    const float f = fresnel_dielectric(cos, b.eta).reflectance;
    return f < 0.02f ? 0.02f : (f > 0.98f ? 0.98f : f);
  }
  // About what a lobe shows of even light, 1 where the viewer is not: light is stronger by eta^2 inside.
  OCTRAD_HD static Vec3f lobe_albedo(const Bsdf& b, float cos) {
    const float f = reflected(b, cos);
    if (b.lobe == Lobe::coat) return b.specular_reflectance * f;
    const float eta = cos >= 0.0f ? b.eta : 1.0f / b.eta;
    return b.specular_transmittance * ((1.0f - f) / (eta * eta));
  }
};

// The refracted direction of a flat boundary; where there is none, along the boundary.
OCTRAD_HD inline Vec3f refracted_direction(float eta, Vec3f wo) {
  const DielectricFresnel f = fresnel_dielectric(wo.z, eta);
  return normalize(Vec3f(-f.eta_ti * wo.x, -f.eta_ti * wo.y, f.cos_transmitted));
}

}  // namespace octrad
