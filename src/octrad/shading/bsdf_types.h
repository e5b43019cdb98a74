// A scattering model evaluated at one point, and what sampling it returns: plain data for host and device.
//
// Directions are in the local shading frame (normal +z) and point away from the surface. `wo` points to the viewer
// or the previous vertex; `wi` points to where light comes from, and is what sampling draws.
#pragma once

#include <cstdint>

#include "octrad/base/vec.h"
#include "octrad/scene/material_types.h"

namespace octrad {

// Samples of the directional transmittance of a rough dielectric boundary at cos = i / (kTransmittanceResolution - 1).
inline constexpr int kTransmittanceResolution = 64;

// Part of a model that is meant: coat or base of plastics, reflection (coat) or transmission (base) of rough glass; the
// others have one part, `all`.
enum class Lobe : std::uint8_t { all, coat, base };

struct MaterialRecord;  // shading/material_record.h

// Parameters of a material at a point: textures looked up, wrappers applied.
struct Bsdf {
  BsdfType type = BsdfType::diffuse;
  Lobe lobe = Lobe::all;
  MicrofacetDistribution distribution = MicrofacetDistribution::ggx;
  bool two_sided = false;
  bool nonlinear = false;
  bool sample_visible = true;
  bool bumped = false;      // the frame is tilted against `base_normal`
  bool shadowed = false;    // bumped, and what the tilt hides darkens gradually
  bool both_sides = false;  // not black from behind although it is not two-sided: glass, blends with such parts
  float opacity = 1.0f;     // probability of not passing straight through
  float alpha_u = 1.0f, alpha_v = 1.0f;
  float eta = 1.0f;  // int_ior / ext_ior
  Vec3f reflectance{0, 0, 0}, specular_reflectance{1, 1, 1}, specular_transmittance{1, 1, 1};
  Vec3f conductor_eta{0, 0, 0}, conductor_k{1, 1, 1};
  Vec3f base_normal{0, 0, 1};  // normal before bump mapping, in the local frame
  // Dielectric coats over a diffuse base (plastic, roughplastic): share of light that the boundary reflects back
  // inside, averaged over directions, and for the rough one its transmittance from outside, kTransmittanceResolution
  // values.
  float internal_reflectance = 0.0f;
  const float* external_transmittance = nullptr;
  // Models with extra parameters (OCTRAD_EXTRA_PARAMETERS), parts or tables: where they find them, and at which
  // coordinates.
  const MaterialRecord* record = nullptr;
  Vec2f uv;
};

struct BsdfValue {
  Vec3f value{0, 0, 0};  // f(wo, wi) |cos wi|, delta lobes excluded
  float pdf = 0.0f;      // solid-angle density with which sampling draws wi, delta lobes excluded
};

struct BsdfSample {
  Vec3f wi;            // local, unit
  Vec3f weight;        // f cos / pdf (for delta lobes: the lobe's weight / its probability)
  float pdf = 0.0f;    // solid angle; for delta lobes the discrete probability
  bool delta = false;  // perfectly specular lobe, or straight through
  bool null = false;   // straight through without interaction (mask)
  bool transmission = false;
  float eta = 1.0f;  // relative index along wi, for Russian roulette (eta^2 scaling)
  bool valid = false;

  // Density and weight of `wi` from the model's value there.
  OCTRAD_HD void weigh(const BsdfValue& v) {
    pdf = v.pdf;
    valid = v.pdf > 0.0f;
    if (valid) weight = v.value / v.pdf;
  }
};

// Roughness that models with a lobe report at most, so that 1 is the diffuse one alone.
inline constexpr float kRoughestLobe = 0.999f;

}  // namespace octrad
