// Disney's model for solid objects (Burley 2012, 2015) as Mitsuba's `principled` has it: a diffuse base with retro-
// reflection, flattening and sheen; a GGX lobe that reflects, tinted, metallic or dielectric, and transmits; a clear
// coat. Reciprocal, but not normalised: sheen, tint and clear coat are added to what is there.
#pragma once

#include "octrad/shading/bsdf/roughdielectric.h"
#include "octrad/shading/material_record.h"

namespace octrad {

// What the functions of both models take instead of a Bsdf.
struct PrincipledInput : ExtraParameters {
  Vec3f base;  // colour
  float eta;   // principled alone
  OCTRAD_HD explicit PrincipledInput(const Bsdf& b) : ExtraParameters(b), base(b.reflectance), eta(b.eta) {}
};

// (1 - cos)^5
OCTRAD_HD inline float schlick_weight(float cos) {
  const float m = 1.0f - cos;
  const float c = m < 0.0f ? 0.0f : (m > 1.0f ? 1.0f : m);
  return c * c * c * c * c;
}
// Schlick's approximation of the Fresnel equations; inside the denser medium with the refracted angle.
template <typename T>
OCTRAD_HD inline T schlick_fresnel(T normal, float cos, float eta) {
  const bool outside = cos >= 0.0f;
  const float eta_it = outside ? eta : 1.0f / eta;
  const float cos_t2 = 1.0f - (1.0f - cos * cos) / (eta_it * eta_it);
  const float w = schlick_weight(eta_it > 1.0f ? std::fabs(cos) : std::sqrt(cos_t2 > 0.0f ? cos_t2 : 0.0f));
  return normal + (T(1.0f) - normal) * w;
}
inline constexpr float kMeanSchlickWeight = 1.0f / 21.0f;  // over a hemisphere, cosine-weighted
OCTRAD_HD inline float schlick_normal_reflectance(float eta) {
  const float r = (eta - 1.0f) / (eta + 1.0f);
  return r * r;
}

// Hue and saturation of the base colour at luminance 1.
OCTRAD_HD inline Vec3f principled_tint(Vec3f base) {
  const float l = luminance(base);
  return l > 0.0f ? base / l : Vec3f(1.0f);
}

OCTRAD_HD inline Microfacet principled_microfacet(float anisotropic, float roughness) {
  const float r2 = roughness * roughness, aspect = std::sqrt(1.0f - 0.9f * anisotropic);
  const float u = r2 / aspect, v = r2 * aspect;
  return {MicrofacetDistribution::ggx, u > 0.001f ? u : 0.001f, v > 0.001f ? v : 0.001f, true};
}
OCTRAD_HD inline float principled_alpha(const Microfacet& m) {
  return std::fmin(std::sqrt(m.alpha_u * m.alpha_v), kRoughestLobe);
}

// Whether facets of normal `h` (+z) see both directions from the side on which a reflection (a refraction) has them.
OCTRAD_HD inline bool facets_agree(Vec3f h, Vec3f wo, Vec3f wi, bool reflects) {
  const float side = wo.z > 0.0f ? 1.0f : -1.0f;
  const float cos_i = dot(wi, h) * side;
  return dot(wo, h) * side > 0.0f && (reflects ? cos_i > 0.0f : cos_i < 0.0f);
}

// Diffuse reflection with retro-reflection and fake subsurface scattering (flatness), f |cos wi| for base colour 1; and
// sheen, whose factors are at its call. wo and wi on one side, `h` between them.
OCTRAD_HD inline float principled_diffuse(float roughness, float flatness, Vec3f wo, Vec3f wi, Vec3f h) {
  const float cos_o = std::fabs(wo.z), cos_i = std::fabs(wi.z);
  const float fi = schlick_weight(cos_i), fo = schlick_weight(cos_o);
  const float cos_d = dot(h, wi);
  const float rr = 2.0f * roughness * cos_d * cos_d;
  float f = (1.0f - 0.5f * fo) * (1.0f - 0.5f * fi) + rr * (fi + fo + fi * fo * (rr - 1.0f));
  if (flatness > 0.0f) {
    const float at90 = 0.5f * rr;
    const float fss = (1.0f + (at90 - 1.0f) * fi) * (1.0f + (at90 - 1.0f) * fo);
    f = lerp(f, 1.25f * (fss * (1.0f / (cos_i + cos_o) - 0.5f) + 0.5f), flatness);
  }
  return f * cos_i * kInvPi;
}
OCTRAD_HD inline Vec3f principled_sheen(Vec3f base, float sheen_tint, Vec3f wi, Vec3f h) {
  return lerp(Vec3f(1.0f), principled_tint(base), Vec3f(sheen_tint)) *
         (schlick_weight(std::fabs(dot(h, wi))) * std::fabs(wi.z));
}
inline constexpr float kMeanSheen = 0.0116f;  // what sheen 1 reflects of even light

// The clear coat's normals: GTR with exponent 1 (Burley 2012).
struct ClearCoat {
  float alpha;
  OCTRAD_HD explicit ClearCoat(float gloss) : alpha(lerp(0.1f, 0.001f, gloss)) {}
  OCTRAD_HD float density(Vec3f m) const {
    const float a2 = alpha * alpha;
    const float d = (a2 - 1.0f) / (kPi * std::log(a2) * (1.0f + (a2 - 1.0f) * m.z * m.z));
    return d * m.z > 1e-20f ? d : 0.0f;
  }
  OCTRAD_HD Vec3f sample(Vec2f u) const {
    const float a2 = alpha * alpha;
    const float cos2 = (1.0f - std::pow(a2, 1.0f - u.y)) / (1.0f - a2);
    const Vec2f across = circle_point(u.x) * std::sqrt(cos2 < 1.0f ? 1.0f - cos2 : 0.0f);
    return {across.x, across.y, std::sqrt(cos2 > 0.0f ? cos2 : 0.0f)};
  }
};
// Masking in the clear coat: always that of roughness 0.25.
OCTRAD_HD inline float clear_coat_masking(Vec3f wo, Vec3f wi, Vec3f h) {
  const Microfacet m(MicrofacetDistribution::ggx, 0.25f, 0.25f, true);
  return m.masking(wo, h) * m.masking(wi, h);
}

// Probabilities with which the lobes are sampled, before they are normalised. `f`: dielectric Fresnel reflectance of
// the facet. From inside there are only facets.
struct PrincipledLobes {
  float diffuse, coat, transmission, reflection;
  OCTRAD_HD PrincipledLobes(const PrincipledInput& in, bool front, float through, float base, float coat_weight,
                            float f) {
    const float specular = front ? in.at(ExtraParameter::main_specular_sampling_rate) : 1.0f;
    diffuse = front ? base * in.at(ExtraParameter::diffuse_reflectance_sampling_rate) : 0.0f;
    coat = front ? 0.25f * coat_weight * in.at(ExtraParameter::clearcoat_sampling_rate) : 0.0f;
    transmission = specular * (front ? through : 1.0f) * (1.0f - f);
    reflection = front ? specular * (1.0f - through * (1.0f - f)) : f;
  }
  OCTRAD_HD float sum() const { return diffuse + coat + transmission + reflection; }
};

OCTRAD_HD_APART inline BsdfValue evaluate_principled(PrincipledInput in, Vec3f wo, Vec3f wi) {
  using P = ExtraParameter;
  BsdfValue out;
  if (wo.z == 0.0f || wi.z == 0.0f) return out;
  const bool front = wo.z > 0.0f, reflects = wo.z * wi.z > 0.0f;
  const float metallic = in.at(P::metallic), spec_trans = in.at(P::spec_trans);
  const float base = (1.0f - metallic) * (1.0f - spec_trans), through = (1.0f - metallic) * spec_trans;
  if (!front && !(through > 0.0f)) return out;
  const float eta = front ? in.eta : 1.0f / in.eta;
  const Vec3f h = half_vector(wo, wi, reflects ? 1.0f : eta);
  const bool facets = facets_agree(h, wo, wi, reflects);
  const float cos_o = dot(wo, h), cos_i = dot(wi, h);
  const float f = fresnel_dielectric(cos_o, in.eta).reflectance;
  const float roughness = in.at(P::roughness), coat = in.at(P::clearcoat);
  const PrincipledLobes lobes(in, front, through, base, coat, f);
  const float sum = lobes.sum(), normalize_lobes = sum > 0.0f ? 1.0f / sum : 0.0f;
  const float jacobian = reflects ? 1.0f / std::fabs(4.0f * cos_i) : refraction_jacobian(cos_o, cos_i, eta);
  if (facets) {
    const Microfacet m = principled_microfacet(in.at(P::anisotropic), roughness);
    const float d = m.density(h), g_o = m.masking(wo, h);
    const float lobe = d * g_o * m.masking(wi, h) * std::fabs(cos_o / wo.z) * jacobian;
    const float share = reflects ? lobes.reflection : lobes.transmission;
    out.pdf = share * normalize_lobes * d * g_o * std::fabs(cos_o / wo.z) * jacobian;
    if (!reflects) {
      // Radiance is divided by eta^2 where it is refracted. The colour is passed twice, on the way in and out.
      const Vec3f color(std::sqrt(in.base.x), std::sqrt(in.base.y), std::sqrt(in.base.z));
      if (f < 1.0f) out.value = color * (through * (1.0f - f) * lobe / (eta * eta));
    } else if (f > 0.0f) {
      Vec3f fresnel(through * f);
      if (front) {
        const float spec_tint = in.at(P::spec_tint);
        fresnel = Vec3f((1.0f - metallic) * (1.0f - spec_tint) * f);
        if (metallic > 0.0f) fresnel += schlick_fresnel(in.base, cos_o, in.eta) * metallic;
        if (spec_tint > 0.0f) {
          const Vec3f normal =
              principled_tint(in.base) * schlick_normal_reflectance(cos_o >= 0.0f ? in.eta : 1.0f / in.eta);
          fresnel += schlick_fresnel(normal, cos_o, in.eta) * ((1.0f - metallic) * spec_tint);
        }
      }
      out.value = fresnel * lobe;
    }
    if (reflects && front && coat > 0.0f) {
      const ClearCoat c(in.at(P::clearcoat_gloss));
      const float dc = c.density(h);
      out.pdf += lobes.coat * normalize_lobes * dc * h.z * jacobian;
      out.value +=
          Vec3f(0.25f * coat * schlick_fresnel(0.04f, cos_o, in.eta) * dc * clear_coat_masking(wo, wi, h) * wi.z);
    }
  }
  if (reflects && front && base > 0.0f) {
    out.pdf += lobes.diffuse * normalize_lobes * wi.z * kInvPi;
    out.value += in.base * (base * principled_diffuse(roughness, in.at(P::flatness), wo, wi, h));
    const float sheen = in.at(P::sheen) * (1.0f - metallic);
    if (sheen > 0.0f) out.value += principled_sheen(in.base, in.at(P::sheen_tint), wi, h) * sheen;
  }
  return out;
}

OCTRAD_HD_APART inline BsdfSample sample_principled(PrincipledInput in, Vec3f wo, float u_lobe, Vec2f u) {
  using P = ExtraParameter;
  BsdfSample s;
  if (wo.z == 0.0f) return s;
  const bool front = wo.z > 0.0f;
  const float metallic = in.at(P::metallic), spec_trans = in.at(P::spec_trans);
  const float base = (1.0f - metallic) * (1.0f - spec_trans), through = (1.0f - metallic) * spec_trans;
  if (!front && !(through > 0.0f)) return s;
  Vec3f h = principled_microfacet(in.at(P::anisotropic), in.at(P::roughness)).sample_normal(front ? wo : -wo, u);
  const DielectricFresnel f = fresnel_dielectric(dot(wo, h), in.eta);
  const PrincipledLobes lobes(in, front, through, base, in.at(P::clearcoat), f.reflectance);
  const float pick = u_lobe * lobes.sum();
  const bool diffuse = pick < lobes.diffuse, coat = !diffuse && pick < lobes.diffuse + lobes.coat;
  s.transmission = !diffuse && !coat && pick < lobes.diffuse + lobes.coat + lobes.transmission;
  if (diffuse) {
    s.wi = square_to_cosine_hemisphere(u);
  } else if (s.transmission) {
    s.wi = refract(wo, h, f.cos_transmitted, f.eta_ti);
    s.eta = f.eta_it;
  } else {
    if (coat) h = ClearCoat(in.at(P::clearcoat_gloss)).sample(u);
    s.wi = reflect(wo, h);
  }
  if (s.transmission ? !(s.wi.z * wo.z < 0.0f) : !(s.wi.z * wo.z > 0.0f)) return s;
  s.weigh(evaluate_principled(in, wo, s.wi));
  return s;
}

// What lobes reflect or let through of even light, whatever the view: what a radiance field is told of surfaces with
// several lobes.
struct LobeEnergies {
  Vec3f diffuse{0, 0, 0}, reflection{0, 0, 0}, transmission{0, 0, 0}, coat{0, 0, 0};
  float alpha = 0.0f, transmission_alpha = 0.0f, coat_alpha = 0.0f;
  OCTRAD_HD Vec3f albedo() const { return diffuse + reflection + transmission + coat; }
  // Mean by luminance; a surface that reflects nothing is rough.
  OCTRAD_HD float roughness() const {
    const float d = luminance(diffuse), r = luminance(reflection), t = luminance(transmission), c = luminance(coat);
    const float sum = d + r + t + c;
    return sum > 0.0f ? (d + r * alpha + t * transmission_alpha + c * coat_alpha) / sum : 1.0f;
  }
  OCTRAD_HD bool mainly_transmits() const { return luminance(transmission) > 0.5f * luminance(albedo()); }
};

OCTRAD_HD_APART inline LobeEnergies principled_energies(PrincipledInput in) {
  using P = ExtraParameter;
  const float metallic = in.at(P::metallic), spec_trans = in.at(P::spec_trans), spec_tint = in.at(P::spec_tint);
  const float dielectric = 1.0f - metallic, f = fresnel_diffuse_reflectance(in.eta);
  LobeEnergies e;
  e.diffuse = in.base * (dielectric * (1.0f - spec_trans)) +
              lerp(Vec3f(1.0f), principled_tint(in.base), Vec3f(in.at(P::sheen_tint))) *
                  (dielectric * kMeanSheen * in.at(P::sheen));
  e.reflection = (in.base + (Vec3f(1.0f) - in.base) * kMeanSchlickWeight) * metallic +
                 lerp(Vec3f(1.0f), principled_tint(in.base), Vec3f(spec_tint)) * (dielectric * f);
  e.transmission =
      Vec3f(std::sqrt(in.base.x), std::sqrt(in.base.y), std::sqrt(in.base.z)) * (dielectric * spec_trans * (1.0f - f));
  e.coat = Vec3f(0.25f * in.at(P::clearcoat) * (0.04f + 0.96f * kMeanSchlickWeight));
  e.alpha = e.transmission_alpha = principled_alpha(principled_microfacet(in.at(P::anisotropic), in.at(P::roughness)));
  e.coat_alpha = ClearCoat(in.at(P::clearcoat_gloss)).alpha;
  return e;
}

struct PrincipledModel {
  static constexpr bool kDeltaOnly = false;

  OCTRAD_HD static BsdfValue evaluate(const Bsdf& b, Vec3f wo, Vec3f wi) {
    return evaluate_principled(PrincipledInput(b), wo, wi);
  }
  OCTRAD_HD static BsdfSample sample(const Bsdf& b, Vec3f wo, float u_lobe, Vec2f u) {
    return sample_principled(PrincipledInput(b), wo, u_lobe, u);
  }
  OCTRAD_HD static Vec3f albedo(const Bsdf& b) { return principled_energies(PrincipledInput(b)).albedo(); }
  OCTRAD_HD static float roughness(const Bsdf& b) { return principled_energies(PrincipledInput(b)).roughness(); }
};

}  // namespace octrad
