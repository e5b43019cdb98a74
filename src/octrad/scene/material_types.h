// The list of scattering models and microfacet distributions. Plain data, for host and device.
#pragma once

#include "octrad/base/hd.h"

namespace octrad {

// Every scattering model: X(name, struct, whether light passes through). The name is that of scene files. The parser,
// dispatch and tests follow this list; the structs are in shading/bsdf/, the parameters are read in load_materials.cc.
#define OCTRAD_BSDF_LIST(X)                     \
  X(diffuse, DiffuseModel, false)               \
  X(plastic, PlasticModel, false)               \
  X(roughplastic, RoughPlasticModel, false)     \
  X(conductor, ConductorModel, false)           \
  X(roughconductor, RoughConductorModel, false) \
  X(dielectric, DielectricModel, true)          \
  X(thindielectric, ThinDielectricModel, true)  \
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

enum class MicrofacetDistribution { beckmann, ggx };

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
