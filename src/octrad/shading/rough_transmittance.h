// Transmittance of a rough dielectric boundary, integrated over all directions: tables for roughplastic.
#pragma once

#include <array>

#include "octrad/shading/bsdf_types.h"

namespace octrad {

struct RoughTransmittance {
  std::array<float, kTransmittanceResolution> external;  // from outside, over cos = i / (resolution - 1)
  float internal_reflectance = 0.0f;                     // from inside, hemispherical mean
};

// `eta` = inside index / outside index > 1. Gauss-Legendre quadrature over the visible-normal samples, with the orders
// and the cos grid of Mitsuba 3's roughplastic, whose values it reproduces. Takes tens of milliseconds.
RoughTransmittance compute_rough_transmittance(MicrofacetDistribution distribution, float alpha, float eta);

}  // namespace octrad
