// Dispatch over the models and the wrappers mask, bumpmap and normalmap: the definition of evaluate and sample for host
// and device.
#pragma once

#include "octrad/shading/bsdf/blendbsdf.h"
#include "octrad/shading/bsdf/conductor.h"
#include "octrad/shading/bsdf/dielectric.h"
#include "octrad/shading/bsdf/diffuse.h"
#include "octrad/shading/bsdf/hair.h"
#include "octrad/shading/bsdf/measured.h"
#include "octrad/shading/bsdf/null.h"
#include "octrad/shading/bsdf/plastic.h"
#include "octrad/shading/bsdf/principled.h"
#include "octrad/shading/bsdf/principledthin.h"
#include "octrad/shading/bsdf/roughconductor.h"
#include "octrad/shading/bsdf/roughdielectric.h"
#include "octrad/shading/bsdf/roughdiffuse.h"
#include "octrad/shading/bsdf/roughplastic.h"
#include "octrad/shading/bsdf/thindielectric.h"

namespace octrad {

// Bump mapping must not open directions that the surface before bumping hides (as Mitsuba's `bumpmap`).
OCTRAD_HD inline bool bump_hides(const Bsdf& b, Vec3f wi) { return b.bumped && dot(b.base_normal, wi) * wi.z <= 0.0f; }

// The dispatches below are of all models, of the parts of a blend, or of the models in kernels of plain worlds.
template <Models kModels>
OCTRAD_HD inline BsdfValue evaluate_listed(const Bsdf& b, Vec3f wo, Vec3f wi) {
  switch (b.type) {
#define OCTRAD_CASE(name, Model, transmits)                                          \
  case BsdfType::name:                                                               \
    if constexpr (knows(kModels, BsdfType::name)) return Model::evaluate(b, wo, wi); \
    break;
    OCTRAD_BSDF_LIST(OCTRAD_CASE)
#undef OCTRAD_CASE
  }
  return {};
}

template <Models kModels>
OCTRAD_HD inline BsdfSample sample_listed(const Bsdf& b, Vec3f wo, float u_lobe, Vec2f u) {
  switch (b.type) {
#define OCTRAD_CASE(name, Model, transmits)                                               \
  case BsdfType::name:                                                                    \
    if constexpr (knows(kModels, BsdfType::name)) return Model::sample(b, wo, u_lobe, u); \
    break;
    OCTRAD_BSDF_LIST(OCTRAD_CASE)
#undef OCTRAD_CASE
  }
  return {};
}

// The functions of models that are no blends, for blends and for all models.
OCTRAD_HD_APART_ON_DEVICE inline BsdfValue evaluate_part(const Bsdf& b, Vec3f wo, Vec3f wi) {
  return evaluate_listed<Models::parts>(b, wo, wi);
}
OCTRAD_HD_APART_ON_DEVICE inline BsdfSample sample_part(const Bsdf& b, Vec3f wo, float u_lobe, Vec2f u) {
  return sample_listed<Models::parts>(b, wo, u_lobe, u);
}

template <Models kModels>
OCTRAD_HD inline BsdfValue evaluate_model(const Bsdf& b, Vec3f wo, Vec3f wi) {
  if constexpr (kModels == Models::plain) return evaluate_listed<kModels>(b, wo, wi);
  if (kModels == Models::all && b.type == BsdfType::blendbsdf) return BlendModel::evaluate(b, wo, wi);
  return evaluate_part(b, wo, wi);
}

template <Models kModels>
OCTRAD_HD inline BsdfSample sample_model(const Bsdf& b, Vec3f wo, float u_lobe, Vec2f u) {
  if constexpr (kModels == Models::plain) return sample_listed<kModels>(b, wo, u_lobe, u);
  if (kModels == Models::all && b.type == BsdfType::blendbsdf) return BlendModel::sample(b, wo, u_lobe, u);
  return sample_part(b, wo, u_lobe, u);
}

// Zero below the surface for one-sided models.
template <Models kModels = Models::all>
OCTRAD_HD inline BsdfValue evaluate_bsdf(const Bsdf& b, Vec3f wo, Vec3f wi) {
  if (bump_hides(b, wi)) return {};
  BsdfValue v = evaluate_model<kModels>(b, wo, wi);
  if (b.shadowed) v.value *= bump_shadowing(b.base_normal.z, dot(b.base_normal, wi));
  v.value *= b.opacity;
  v.pdf *= b.opacity;
  return v;
}

// The two outcomes of sample_bsdf(), in functions of their own: a sample that is copied has to wait for its stores.
OCTRAD_HD inline BsdfSample sample_pass(const Bsdf& b, Vec3f wo) {
  BsdfSample s;
  s.wi = -wo;
  s.weight = Vec3f(1.0f);
  s.pdf = 1.0f - b.opacity;
  s.delta = s.null = s.transmission = s.valid = true;
  return s;
}
template <Models kModels = Models::all>
OCTRAD_HD inline BsdfSample sample_opaque(const Bsdf& b, Vec3f wo, float u_lobe, Vec2f u) {
  BsdfSample s =
      sample_model<kModels>(b, wo, u_lobe, u);  // one call, so that kernels contain the code of all models once
  s.pdf *= b.opacity;
  if (s.valid && bump_hides(b, s.wi)) s.valid = false;
  if (s.valid && b.shadowed) s.weight *= bump_shadowing(b.base_normal.z, dot(b.base_normal, s.wi));
  return s;
}

// Draws wi. `u_lobe` picks the lobe, `u` the direction; all uniform in [0, 1). Invalid samples carry no light.
template <Models kModels = Models::all>
OCTRAD_HD inline BsdfSample sample_bsdf(const Bsdf& b, Vec3f wo, float u_lobe, Vec2f u) {
  if (u_lobe >= b.opacity) return sample_pass(b, wo);
  if (b.opacity < 1.0f) {
    u_lobe /= b.opacity;
    if (!(u_lobe < 0.99999994f)) u_lobe = 0.99999994f;
  }
  return sample_opaque<kModels>(b, wo, u_lobe, u);
}

// Whether the model has only delta (or null) lobes: smooth conductor, dielectric, thin dielectric.
OCTRAD_HD inline bool is_delta_bsdf(const Bsdf& b) {
  switch (b.type) {
#define OCTRAD_CASE(name, Model, transmits) \
  case BsdfType::name: return Model::kDeltaOnly;
    OCTRAD_BSDF_LIST(OCTRAD_CASE)
#undef OCTRAD_CASE
  }
  return false;
}

// What a radiance field is told of the surface: view-independent albedo, and roughness (1 for diffuse, 0 for smooth).
template <Models kModels = Models::all>
OCTRAD_HD inline Vec3f albedo_bsdf(const Bsdf& b) {
  switch (b.type) {
#define OCTRAD_CASE(name, Model, transmits)                                \
  case BsdfType::name:                                                     \
    if constexpr (knows(kModels, BsdfType::name)) return Model::albedo(b); \
    break;
    OCTRAD_BSDF_LIST(OCTRAD_CASE)
#undef OCTRAD_CASE
  }
  return {};
}

template <Models kModels = Models::all>
OCTRAD_HD inline float roughness_bsdf(const Bsdf& b) {
  switch (b.type) {
#define OCTRAD_CASE(name, Model, transmits)                                   \
  case BsdfType::name:                                                        \
    if constexpr (knows(kModels, BsdfType::name)) return Model::roughness(b); \
    break;
    OCTRAD_BSDF_LIST(OCTRAD_CASE)
#undef OCTRAD_CASE
  }
  return 1.0f;
}

OCTRAD_HD inline bool is_coated(const Bsdf& b) {
  return b.type == BsdfType::plastic || b.type == BsdfType::roughplastic;
}

// Share of light that a coat reflects towards `cos` = cos of wo, under even light.
OCTRAD_HD inline float coat_reflectance(const Bsdf& b, float cos) {
  cos = cos > 0.0f ? cos : 0.0f;
  return b.type == BsdfType::plastic ? PlasticModel::reflected(b, cos) : RoughPlasticModel::reflected(b, cos);
}

// Whether its lobes may be points of their own (lookup.coats = split).
OCTRAD_HD inline bool has_lobes(const Bsdf& b) { return is_coated(b) || b.type == BsdfType::roughdielectric; }

// Reflectance of the lobe that is meant, towards wo under even light; where all are meant, albedo_bsdf(). Seen through
// the coat, the base is lit by 1 - internal reflectance of the light outside, by reciprocity.
template <Models kModels = Models::all>
OCTRAD_HD inline Vec3f lobe_albedo(const Bsdf& b, Vec3f wo) {
  if (b.lobe == Lobe::all) return albedo_bsdf<kModels>(b);
  if (b.type == BsdfType::roughdielectric) return RoughDielectricModel::lobe_albedo(b, wo.z);
  const float reflected = coat_reflectance(b, wo.z);
  if (b.lobe == Lobe::coat) return b.specular_reflectance * reflected;
  return base_reflectance(b) * ((1.0f - reflected) * (1.0f - b.internal_reflectance));
}

// Rays pass a surface like a mirror: it has one lobe, or two of glass, and its roughness is below `follow_below` (0:
// none passes; kFollowDelta: perfect mirrors and glass). A blend has all kinds of lobes, unless all are smooth.
template <Models kModels = Models::all>
OCTRAD_HD inline bool is_followed(const Bsdf& b, float follow_below) {
  if (is_coated(b) && b.lobe != Lobe::coat) return false;
  const float roughness = roughness_bsdf<kModels>(b);
  return roughness < follow_below && (b.type != BsdfType::blendbsdf || roughness == 0.0f);
}

// Restricts a model to one of its lobes by chance; returns 1 / probability of the choice. Neither lobe is rarer
// than one in five: what the lobes reflect under even light says little about a lamp in the coat's mirror direction.
OCTRAD_HD inline float choose_lobe(Bsdf& b, Vec3f wo, float u) {
  float coat = b.type == BsdfType::roughdielectric ? RoughDielectricModel::reflected(b, wo.z)
                                                   : coat_probability(b, coat_reflectance(b, wo.z));
  coat = coat < 0.2f ? 0.2f : (coat > 0.8f ? 0.8f : coat);
  const bool chosen = u < coat;
  b.lobe = chosen ? Lobe::coat : Lobe::base;
  return 1.0f / (chosen ? coat : 1.0f - coat);
}

// What the lobes of a model that is no blend reflect and let through.
OCTRAD_HD inline LobeEnergies energies_bsdf(const Bsdf& b) {
  if (b.type == BsdfType::principled) return principled_energies(PrincipledInput(b));
  if (b.type == BsdfType::principledthin) return principled_thin_energies(PrincipledInput(b));
  if (b.type == BsdfType::hair) return hair_energies(HairInput(b));
  LobeEnergies e;
  const float roughness = roughness_bsdf<Models::parts>(b);
  e.alpha = e.transmission_alpha = e.coat_alpha = roughness;
  if (is_coated(b)) {
    const float coat = fresnel_diffuse_reflectance(b.eta);
    e.coat = b.specular_reflectance * coat;
    e.diffuse = b.reflectance * (1.0f - coat);
  } else if (transmits(b.type)) {
    const float f = fresnel_diffuse_reflectance(b.eta);
    e.reflection = b.specular_reflectance * f;
    e.transmission = b.specular_transmittance * (1.0f - f);
  } else if (roughness < 1.0f) {
    e.reflection = albedo_bsdf<Models::parts>(b);
  } else {
    e.diffuse = albedo_bsdf<Models::parts>(b);
  }
  return e;
}

// Whether a surface seen from `wo` mainly shows what is behind it, blurred, and the direction in which that lies.
// Smooth glass is not meant: it is followed, or looked up like a mirror.
struct SeenThrough {
  bool mainly = false;
  Vec3f direction;
};
OCTRAD_HD_APART inline SeenThrough principled_seen_through(BsdfType type, PrincipledInput in, Vec3f wo) {
  if (type == BsdfType::principledthin) return {principled_thin_energies(in).mainly_transmits(), -wo};
  // From inside there is nothing but glass.
  return {
      wo.z > 0.0f ? principled_energies(in).mainly_transmits() : fresnel_dielectric(wo.z, in.eta).reflectance < 0.5f,
      refracted_direction(in.eta, wo)};
}
template <Models kModels = Models::all>
OCTRAD_HD inline SeenThrough seen_through(const Bsdf& b, Vec3f wo);

struct BlendSummary {
  Vec3f albedo{0, 0, 0};
  float roughness = 1.0f;
};
OCTRAD_HD_APART inline BlendSummary summarize_blend(const MaterialRecord& record, Vec2f uv) {
  const Vec3f above(0, 0, 1);
  const BlendParts parts(record, uv, 1.0f);
  BlendSummary summary;
  float energy = 0.0f, rough = 0.0f;
  for (int i = 0; i < parts.count; ++i) {
    const BlendedModel model(parts.part[i], uv, above);
    const LobeEnergies e = energies_bsdf(model.bsdf);
    const float weight = parts.part[i].weight / parts.sum;
    const Vec3f albedo = e.albedo() * weight;
    summary.albedo += albedo;
    energy += luminance(albedo);
    rough += luminance(albedo) * e.roughness();
  }
  // Parts that are all diffuse are exactly so.
  if (energy > 0.0f) summary.roughness = rough < energy ? rough / energy : 1.0f;
  return summary;
}

OCTRAD_HD_APART inline BsdfValue evaluate_blend(const MaterialRecord& record, Vec2f uv, Vec3f wo, Vec3f wi) {
  const BlendParts parts(record, uv, wo.z);
  BsdfValue sum;
  for (int i = 0; i < parts.count; ++i) {
    const BlendedModel model(parts.part[i], uv, wo);
    const BsdfValue v = evaluate_bsdf<Models::parts>(model.bsdf, model.to_part(wo), model.to_part(wi));
    const float weight = parts.part[i].weight / parts.sum;
    sum.value += v.value * weight;
    sum.pdf += v.pdf * weight;
  }
  return sum;
}

OCTRAD_HD_APART inline BsdfSample sample_blend(const MaterialRecord& record, Vec2f uv, Vec3f wo, float u_lobe,
                                               Vec2f u) {
  const BlendParts parts(record, uv, wo.z);
  BsdfSample s;
  if (parts.count == 0) return s;
  float left = u_lobe * parts.sum;
  int i = 0;
  for (; i + 1 < parts.count && left >= parts.part[i].weight; ++i) left -= parts.part[i].weight;
  left /= parts.part[i].weight;
  const BlendedModel model(parts.part[i], uv, wo);
  s = sample_opaque<Models::parts>(model.bsdf, model.to_part(wo), left < 0.99999994f ? left : 0.99999994f, u);
  if (!s.valid) return s;
  s.wi = model.from_part(s.wi);
  if (s.delta) {
    s.pdf *= parts.part[i].weight / parts.sum;
    return s;
  }
  s.weigh(evaluate_blend(record, uv, wo, s.wi));
  return s;
}

// A blend is seen through as its strongest part is.
OCTRAD_HD_APART inline SeenThrough blend_seen_through(const MaterialRecord& record, Vec2f uv, Vec3f wo) {
  const BlendParts parts(record, uv, wo.z);
  int strongest = 0;
  float most = -1.0f;
  for (int i = 0; i < parts.count; ++i) {
    const BlendedModel model(parts.part[i], uv, wo);
    const float energy = parts.part[i].weight * luminance(energies_bsdf(model.bsdf).albedo());
    if (energy > most) strongest = i;
    if (energy > most) most = energy;
  }
  if (parts.count == 0) return {};
  const BlendedModel model(parts.part[strongest], uv, wo);
  const SeenThrough seen = seen_through<Models::parts>(model.bsdf, model.to_part(wo));
  return {seen.mainly, model.from_part(seen.direction)};
}

template <Models kModels>
OCTRAD_HD inline SeenThrough seen_through(const Bsdf& b, Vec3f wo) {
  if constexpr (kModels == Models::plain) return {};
  switch (b.type) {
    case BsdfType::roughdielectric:
      return {b.lobe == Lobe::base || (b.lobe == Lobe::all && RoughDielectricModel::reflected(b, wo.z) < 0.5f),
              refracted_direction(b.eta, wo)};
    case BsdfType::principled:
    case BsdfType::principledthin: return principled_seen_through(b.type, PrincipledInput(b), wo);
    case BsdfType::blendbsdf:
      if constexpr (kModels == Models::all) return blend_seen_through(*b.record, b.uv, wo);
      break;
    default: break;
  }
  return {};
}

OCTRAD_HD inline BsdfValue BlendModel::evaluate(const Bsdf& b, Vec3f wo, Vec3f wi) {
  return evaluate_blend(*b.record, b.uv, wo, wi);
}
OCTRAD_HD inline BsdfSample BlendModel::sample(const Bsdf& b, Vec3f wo, float u_lobe, Vec2f u) {
  return sample_blend(*b.record, b.uv, wo, u_lobe, u);
}
OCTRAD_HD inline Vec3f BlendModel::albedo(const Bsdf& b) { return summarize_blend(*b.record, b.uv).albedo; }
OCTRAD_HD inline float BlendModel::roughness(const Bsdf& b) { return summarize_blend(*b.record, b.uv).roughness; }

}  // namespace octrad
