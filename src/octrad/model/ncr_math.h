// What Neural Cone Radiosity computes for one point beside its networks (Ren et al. 2025, arXiv 2509.07522; method
// section 9). The definition, for host and device.
#pragma once

#include <cmath>

#include "octrad/model/decoder_math.h"

namespace octrad {

// Tangent of a GGX lobe's half-angle: the theta up to which the integral of D over theta is `share` of that up to
// pi/2. With tan theta = alpha tan phi the integral is, up to a factor,
//     phi + k/2 sin 2 phi,   k = (1 - alpha^2) / (1 + alpha^2),
// so phi solves Kepler's equation 2 phi + k sin 2 phi = share pi. The left side is concave for k >= 0: Newton's steps
// from 0 rise to the root. alpha in [0, 1], share in (0, 1).
OCTRAD_HD inline double lobe_tangent_exact(double alpha, double share) {
  const double k = (1.0 - alpha * alpha) / (1.0 + alpha * alpha), whole = 3.14159265358979323846 * share;
  double twice = 0.0;
  for (int i = 0; i < 50; ++i) {
    const double step = (whole - twice - k * std::sin(twice)) / (1.0 + k * std::cos(twice));
    twice += step;
    if (!(step > 1e-14)) break;
  }
  return alpha * std::tan(0.5 * twice);
}

// The same from a table, linear between its entries: off by less than 1e-3 of the value.
struct LobeTable {
  static constexpr int kSteps = 256;
  float tangent[kSteps + 1];

  OCTRAD_HD float operator()(float alpha) const {
    const float at = clamp_to_unit(alpha) * static_cast<float>(kSteps);
    const int i = at < static_cast<float>(kSteps - 1) ? static_cast<int>(at) : kSteps - 1;
    const float f = at - static_cast<float>(i);
    return tangent[i] * (1.0f - f) + tangent[i + 1] * f;
  }

 private:
  OCTRAD_HD static float clamp_to_unit(float a) { return a > 0.0f ? (a < 1.0f ? a : 1.0f) : 0.0f; }
};

inline LobeTable lobe_table(double share) {
  LobeTable table;
  for (int i = 0; i <= LobeTable::kSteps; ++i)
    table.tangent[i] = static_cast<float>(lobe_tangent_exact(static_cast<double>(i) / LobeTable::kSteps, share));
  return table;
}

// Where the cone of a cluster of hits ends: the position of its look-up, and the radius there.
struct ConeEnd {
  Vec3f x;  // world
  float r;  // world
};

OCTRAD_HD inline ConeEnd cone_end(const SurfacePoint& point, Vec3f mirror, const HitCluster& cluster, float tangent) {
  return {point.x + mirror * cluster.distance, 0.5f * (cluster.distance * tangent + cluster.deviation)};
}

inline constexpr int kConePointInputs = 7;  // beside the features: position (3), direction back (3), radius (1)
inline constexpr int kMergeInputs = 10;     // diffuse (3), glossy (3), alpha (1), albedo (3)

}  // namespace octrad
