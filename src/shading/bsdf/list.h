// Every scattering model: X(enumerator of BsdfType, struct). Dispatch, tests and documentation iterate this list.
#pragma once

#include "shading/bsdf/conductor.h"
#include "shading/bsdf/dielectric.h"
#include "shading/bsdf/diffuse.h"
#include "shading/bsdf/plastic.h"
#include "shading/bsdf/roughconductor.h"
#include "shading/bsdf/roughplastic.h"
#include "shading/bsdf/thindielectric.h"

#define OCTRAD_BSDF_LIST(X)             \
  X(diffuse, DiffuseModel)              \
  X(plastic, PlasticModel)              \
  X(roughplastic, RoughPlasticModel)    \
  X(conductor, ConductorModel)          \
  X(roughconductor, RoughConductorModel) \
  X(dielectric, DielectricModel)        \
  X(thindielectric, ThinDielectricModel)
