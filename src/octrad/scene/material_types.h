// The list of scattering models and microfacet distributions. Plain data, for host and device.
#pragma once

#include "octrad/base/hd.h"

namespace octrad {

// Every scattering model: X(name, struct, whether light passes through whatever the parameters are). The name is that
// of scene files. The parser, dispatch and tests follow this list; the structs are in shading/bsdf/, the parameters are
// read in load_materials.cc.
#define OCTRAD_BSDF_LIST(X)                      \
  X(diffuse, DiffuseModel, false)                \
  X(plastic, PlasticModel, false)                \
  X(roughplastic, RoughPlasticModel, false)      \
  X(conductor, ConductorModel, false)            \
  X(roughconductor, RoughConductorModel, false)  \
  X(dielectric, DielectricModel, true)           \
  X(thindielectric, ThinDielectricModel, true)   \
  X(roughdielectric, RoughDielectricModel, true) \
  X(null, NullModel, true)                       \
  X(blendbsdf, BlendModel, false)                \
  X(principled, PrincipledModel, false)          \
  X(principledthin, PrincipledThinModel, true)   \
  X(roughdiffuse, RoughDiffuseModel, false)      \
  X(hair, HairModel, true)                       \
  X(measured, MeasuredModel, false)              \
  /* more models: at the end, for fingerprints of scenes hold the number */

#define OCTRAD_NAME(name, Model, transmits) name,
enum class BsdfType { OCTRAD_BSDF_LIST(OCTRAD_NAME) };
#undef OCTRAD_NAME

// Parameters of the models that a texture may drive: X(member of Material and of Bsdf).
#define OCTRAD_MATERIAL_SLOTS(X) \
  X(reflectance)                 \
  X(specular_reflectance)        \
  X(specular_transmittance)      \
  X(alpha_u)                     \
  X(alpha_v)                     \
  /* more parameters */

// Scalars that few models have; these look them up where they need them: X(name in Material and scene files).
#define OCTRAD_EXTRA_PARAMETERS(X)        \
  X(weight)                               \
  X(roughness)                            \
  X(metallic)                             \
  X(anisotropic)                          \
  X(spec_trans)                           \
  X(spec_tint)                            \
  X(sheen)                                \
  X(sheen_tint)                           \
  X(flatness)                             \
  X(clearcoat)                            \
  X(clearcoat_gloss)                      \
  X(diff_trans)                           \
  X(eta)                                  \
  X(main_specular_sampling_rate)          \
  X(clearcoat_sampling_rate)              \
  X(specular_reflectance_sampling_rate)   \
  X(specular_transmittance_sampling_rate) \
  X(diffuse_reflectance_sampling_rate)    \
  X(diffuse_transmittance_sampling_rate)  \
  X(azimuthal_roughness)                  \
  X(scale_tilt)

struct ExtraParameter {
#define OCTRAD_NAME(name) name,
  enum : int { OCTRAD_EXTRA_PARAMETERS(OCTRAD_NAME) count };
#undef OCTRAD_NAME
};
// Models that are blended, at most; blends in blends count by their parts.
inline constexpr int kMostBlended = 8;

enum class MicrofacetDistribution { beckmann, ggx };

// Whether a Bsdf of the model refers to its record.
OCTRAD_HD inline bool needs_record(BsdfType type) {
  return type == BsdfType::principled || type == BsdfType::principledthin || type == BsdfType::blendbsdf ||
         type == BsdfType::hair || type == BsdfType::measured;
}

// Models that are in the kernels of scenes that have them alone (shading/device_world.h): all others fit into
// registers.
OCTRAD_HD constexpr bool is_extended(BsdfType type) { return type >= BsdfType::roughdielectric; }

// Which models code has to know: every one, those that may be parts of a blend, or those that are not extended.
enum class Models { all, parts, plain };
OCTRAD_HD constexpr bool knows(Models models, BsdfType type) {
  return models == Models::all || (models == Models::parts ? type != BsdfType::blendbsdf : !is_extended(type));
}

OCTRAD_HD inline bool transmits(BsdfType type) {
  switch (type) {
#define OCTRAD_CASE(name, Model, transmits) \
  case BsdfType::name: return transmits;
    OCTRAD_BSDF_LIST(OCTRAD_CASE)
#undef OCTRAD_CASE
  }
  return false;
}

}  // namespace octrad
