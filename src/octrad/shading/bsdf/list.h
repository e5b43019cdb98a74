// Every scattering model: X(enumerator of BsdfType, struct). Dispatch, tests and documentation iterate this list.
#pragma once

#include "octrad/shading/bsdf/conductor.h"
#include "octrad/shading/bsdf/dielectric.h"
#include "octrad/shading/bsdf/diffuse.h"
#include "octrad/shading/bsdf/plastic.h"
#include "octrad/shading/bsdf/roughconductor.h"
#include "octrad/shading/bsdf/roughplastic.h"
#include "octrad/shading/bsdf/thindielectric.h"

#define OCTRAD_BSDF_LIST(X)              \
  X(diffuse, DiffuseModel)               \
  X(plastic, PlasticModel)               \
  X(roughplastic, RoughPlasticModel)     \
  X(conductor, ConductorModel)           \
  X(roughconductor, RoughConductorModel) \
  X(dielectric, DielectricModel)         \
  X(thindielectric, ThinDielectricModel)
