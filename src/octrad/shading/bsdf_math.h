// Dispatch over the models and the wrappers mask and bumpmap: the definition of evaluate and sample for host and
// device.
#pragma once

#include "octrad/shading/bsdf/conductor.h"
#include "octrad/shading/bsdf/dielectric.h"
#include "octrad/shading/bsdf/diffuse.h"
#include "octrad/shading/bsdf/plastic.h"
#include "octrad/shading/bsdf/roughconductor.h"
#include "octrad/shading/bsdf/roughplastic.h"
#include "octrad/shading/bsdf/thindielectric.h"

namespace octrad {

// Bump mapping must not open directions that the surface before bumping hides (as Mitsuba's `bumpmap`).
OCTRAD_HD inline bool bump_hides(const Bsdf& b, Vec3f wi) { return b.bumped && dot(b.base_normal, wi) * wi.z <= 0.0f; }

// Zero below the surface for one-sided models.
OCTRAD_HD inline BsdfValue evaluate_bsdf(const Bsdf& b, Vec3f wo, Vec3f wi) {
  if (bump_hides(b, wi)) return {};
  BsdfValue v;
  switch (b.type) {
#define OCTRAD_CASE(name, Model, transmits) \
  case BsdfType::name: v = Model::evaluate(b, wo, wi); break;
    OCTRAD_BSDF_LIST(OCTRAD_CASE)
#undef OCTRAD_CASE
  }
  v.value *= b.opacity;
  v.pdf *= b.opacity;
  return v;
}

OCTRAD_HD inline BsdfSample sample_model(const Bsdf& b, Vec3f wo, float u_lobe, Vec2f u) {
  switch (b.type) {
#define OCTRAD_CASE(name, Model, transmits) \
  case BsdfType::name: return Model::sample(b, wo, u_lobe, u);
    OCTRAD_BSDF_LIST(OCTRAD_CASE)
#undef OCTRAD_CASE
  }
  return {};
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
OCTRAD_HD inline BsdfSample sample_opaque(const Bsdf& b, Vec3f wo, float u_lobe, Vec2f u) {
  BsdfSample s = sample_model(b, wo, u_lobe, u);  // one call, so that kernels contain the code of all models once
  s.pdf *= b.opacity;
  if (s.valid && !s.transmission && bump_hides(b, s.wi)) s.valid = false;
  return s;
}

// Draws wi. `u_lobe` picks the lobe, `u` the direction; all uniform in [0, 1). Invalid samples carry no light.
OCTRAD_HD inline BsdfSample sample_bsdf(const Bsdf& b, Vec3f wo, float u_lobe, Vec2f u) {
  if (u_lobe >= b.opacity) return sample_pass(b, wo);
  if (b.opacity < 1.0f) {
    u_lobe /= b.opacity;
    if (!(u_lobe < 0.99999994f)) u_lobe = 0.99999994f;
  }
  return sample_opaque(b, wo, u_lobe, u);
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
OCTRAD_HD inline Vec3f albedo_bsdf(const Bsdf& b) {
  switch (b.type) {
#define OCTRAD_CASE(name, Model, transmits) \
  case BsdfType::name: return Model::albedo(b);
    OCTRAD_BSDF_LIST(OCTRAD_CASE)
#undef OCTRAD_CASE
  }
  return {};
}

OCTRAD_HD inline float roughness_bsdf(const Bsdf& b) {
  switch (b.type) {
#define OCTRAD_CASE(name, Model, transmits) \
  case BsdfType::name: return Model::roughness(b);
    OCTRAD_BSDF_LIST(OCTRAD_CASE)
#undef OCTRAD_CASE
  }
  return 1.0f;
}

}  // namespace octrad
