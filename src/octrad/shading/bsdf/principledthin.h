// Disney's model for thin objects (Burley 2015) as Mitsuba's `principledthin` has it: diffuse reflection with retro-
// reflection, flattening and sheen, diffuse transmission, and a GGX pane whose transmission goes straight through,
// blurred. Both sides are alike.
#pragma once

#include "octrad/shading/bsdf/principled.h"

namespace octrad {

struct PrincipledThinLobes {
  float reflection, transmission, diffuse, diffuse_transmission;
  OCTRAD_HD PrincipledThinLobes(const PrincipledInput& in, float spec_trans, float diff_trans) {
    using P = ExtraParameter;
    reflection = 0.5f * spec_trans * in.at(P::specular_reflectance_sampling_rate);
    transmission = 0.5f * spec_trans * in.at(P::specular_transmittance_sampling_rate);
    diffuse = (1.0f - spec_trans) * (1.0f - diff_trans) * in.at(P::diffuse_reflectance_sampling_rate);
    diffuse_transmission = (1.0f - spec_trans) * diff_trans * in.at(P::diffuse_transmittance_sampling_rate);
  }
  OCTRAD_HD float sum() const { return reflection + transmission + diffuse + diffuse_transmission; }
};

// Facets of the pane; its transmission is narrower or wider with the index (Burley 2015, figure 15).
OCTRAD_HD inline Microfacet thin_microfacet(const PrincipledInput& in, bool reflects) {
  const float roughness = in.at(ExtraParameter::roughness);
  return principled_microfacet(in.at(ExtraParameter::anisotropic),
                               reflects ? roughness : (0.65f * in.at(ExtraParameter::eta) - 0.35f) * roughness);
}

OCTRAD_HD_APART inline BsdfValue evaluate_principled_thin(PrincipledInput in, Vec3f wo, Vec3f wi) {
  using P = ExtraParameter;
  BsdfValue out;
  if (wo.z == 0.0f || wi.z == 0.0f) return out;
  if (wo.z < 0.0f) {
    wo = -wo;
    wi = -wi;
  }
  const bool reflects = wi.z > 0.0f;
  const Vec3f folded(wi.x, wi.y, std::fabs(wi.z));  // transmission as a reflection
  const Vec3f h = normalize(wo + folded);
  const float spec_trans = in.at(P::spec_trans), diff_trans = 0.5f * in.at(P::diff_trans);
  const PrincipledThinLobes lobes(in, spec_trans, diff_trans);
  const float sum = lobes.sum(), normalize_lobes = sum > 0.0f ? 1.0f / sum : 0.0f;
  if (spec_trans > 0.0f && facets_agree(h, wo, wi, reflects)) {
    const float eta = in.at(P::eta), cos_o = dot(wo, h);
    const float f = fresnel_dielectric(cos_o, eta).reflectance;
    const Microfacet m = thin_microfacet(in, reflects);
    const float d = m.density(h), g_o = m.masking(wo, h);
    const float visible = d * g_o * std::fabs(cos_o / wo.z) / std::fabs(4.0f * dot(folded, h));
    out.pdf = (reflects ? lobes.reflection : lobes.transmission) * normalize_lobes * visible;
    Vec3f color = in.base * (1.0f - f);
    if (reflects) {
      const float spec_tint = in.at(P::spec_tint);
      color = Vec3f(f);
      if (spec_tint > 0.0f) {
        const Vec3f tinted = schlick_fresnel(principled_tint(in.base) * schlick_normal_reflectance(eta), cos_o, eta);
        color = lerp(color, tinted, Vec3f(spec_tint));
      }
    }
    out.value = color * (spec_trans * d * g_o * m.masking(wi, h) / (4.0f * wo.z));
  }
  const float rest = 1.0f - spec_trans;
  if (reflects) {
    out.pdf += lobes.diffuse * normalize_lobes * wi.z * kInvPi;
    const float share = rest * (1.0f - diff_trans);
    if (share > 0.0f) {
      out.value += in.base * (share * principled_diffuse(in.at(P::roughness), in.at(P::flatness), wo, wi, h));
      const float sheen = in.at(P::sheen);
      if (sheen > 0.0f) out.value += principled_sheen(in.base, in.at(P::sheen_tint), wi, h) * (sheen * share);
    }
  } else {
    out.pdf += lobes.diffuse_transmission * normalize_lobes * -wi.z * kInvPi;
    out.value += in.base * (rest * diff_trans * -wi.z * kInvPi);
  }
  return out;
}

OCTRAD_HD_APART inline BsdfSample sample_principled_thin(PrincipledInput in, Vec3f wo, float u_lobe, Vec2f u) {
  BsdfSample s;
  if (wo.z == 0.0f) return s;
  const float side = wo.z > 0.0f ? 1.0f : -1.0f;
  const PrincipledThinLobes lobes(in, in.at(ExtraParameter::spec_trans), 0.5f * in.at(ExtraParameter::diff_trans));
  const float pick = u_lobe * lobes.sum();
  const bool reflection = pick < lobes.reflection;
  const bool transmission = !reflection && pick < lobes.reflection + lobes.transmission;
  if (reflection || transmission) {
    const Vec3f v = wo * side;
    const Vec3f h = thin_microfacet(in, reflection).sample_normal(v, u);
    s.wi = reflect(v, h);
    if (!(s.wi.z > 0.0f)) return s;
    if (transmission) s.wi.z = -s.wi.z;
    if (!facets_agree(h, v, s.wi, reflection)) return s;
  } else {
    s.wi = square_to_cosine_hemisphere(u);
    if (!(pick < lobes.reflection + lobes.transmission + lobes.diffuse)) s.wi = -s.wi;
  }
  s.transmission = s.wi.z < 0.0f;
  s.wi = s.wi * side;
  s.weigh(evaluate_principled_thin(in, wo, s.wi));
  return s;
}

OCTRAD_HD_APART inline LobeEnergies principled_thin_energies(PrincipledInput in) {
  using P = ExtraParameter;
  const float spec_trans = in.at(P::spec_trans), f = fresnel_diffuse_reflectance(in.at(P::eta));
  const Vec3f tint = principled_tint(in.base);
  LobeEnergies e;
  e.diffuse = in.base * (1.0f - spec_trans) + lerp(Vec3f(1.0f), tint, Vec3f(in.at(P::sheen_tint))) *
                                                  ((1.0f - spec_trans) * kMeanSheen * in.at(P::sheen));
  e.reflection = lerp(Vec3f(1.0f), tint, Vec3f(in.at(P::spec_tint))) * (spec_trans * f);
  e.transmission = in.base * (spec_trans * (1.0f - f));
  e.alpha = principled_alpha(thin_microfacet(in, true));
  e.transmission_alpha = principled_alpha(thin_microfacet(in, false));
  return e;
}

struct PrincipledThinModel {
  static constexpr bool kDeltaOnly = false;

  OCTRAD_HD static BsdfValue evaluate(const Bsdf& b, Vec3f wo, Vec3f wi) {
    return evaluate_principled_thin(PrincipledInput(b), wo, wi);
  }
  OCTRAD_HD static BsdfSample sample(const Bsdf& b, Vec3f wo, float u_lobe, Vec2f u) {
    return sample_principled_thin(PrincipledInput(b), wo, u_lobe, u);
  }
  OCTRAD_HD static Vec3f albedo(const Bsdf& b) { return principled_thin_energies(PrincipledInput(b)).albedo(); }
  OCTRAD_HD static float roughness(const Bsdf& b) { return principled_thin_energies(PrincipledInput(b)).roughness(); }
};

}  // namespace octrad
