#include "octrad/shading/rough_transmittance.h"

#include <cmath>
#include <numbers>
#include <vector>

#include "octrad/base/threads.h"
#include "octrad/shading/fresnel.h"
#include "octrad/shading/microfacet.h"

namespace octrad {
namespace {

struct Quadrature {
  std::vector<double> nodes, weights;  // on [0, 1]
};

// Gauss-Legendre rule of n points: roots of P_n by Newton's method.
Quadrature gauss_legendre(int n) {
  Quadrature q;
  for (int i = 0; i < n; ++i) {
    double x = std::cos(std::numbers::pi * (i + 0.75) / (n + 0.5)), derivative = 1.0;
    for (int step = 0; step < 100; ++step) {
      double p0 = 1.0, p1 = x;
      for (int k = 2; k <= n; ++k) {
        const double p2 = ((2 * k - 1) * x * p1 - (k - 1) * p0) / k;
        p0 = p1;
        p1 = p2;
      }
      derivative = n * (x * p1 - p0) / (x * x - 1.0);
      const double dx = p1 / derivative;
      x -= dx;
      if (std::fabs(dx) < 1e-15) break;
    }
    q.nodes.push_back(0.5 - 0.5 * x);
    q.weights.push_back(1.0 / ((1.0 - x * x) * derivative * derivative));
  }
  return q;
}

// Mean over visible normals, seen from cos, of what the boundary reflects (or lets through) and the facets do not
// block.
double integrate(const Microfacet& microfacet, const Quadrature& q, float cos, float eta, bool transmit) {
  const Vec3f w{std::sqrt(std::fmax(0.0f, 1.0f - cos * cos)), 0.0f, cos};
  double sum = 0.0;
  for (std::size_t j = 0; j < q.nodes.size(); ++j) {
    for (std::size_t i = 0; i < q.nodes.size(); ++i) {
      const Vec3f m = microfacet.sample_normal(w, {static_cast<float>(q.nodes[i]), static_cast<float>(q.nodes[j])});
      const DielectricFresnel f = fresnel_dielectric(dot(w, m), eta);
      const Vec3f out = transmit ? refract(w, m, f.cos_transmitted, f.eta_ti) : reflect(w, m);
      if (transmit ? out.z >= 0.0f : out.z <= 0.0f) continue;
      const double share = transmit ? 1.0 - static_cast<double>(f.reflectance) : static_cast<double>(f.reflectance);
      sum += q.weights[i] * q.weights[j] * share * static_cast<double>(microfacet.masking(out, m));
    }
  }
  return sum;
}

}  // namespace

RoughTransmittance compute_rough_transmittance(MicrofacetDistribution distribution, float alpha, float eta) {
  const Microfacet microfacet(distribution, alpha, alpha, true);
  const Quadrature coarse = gauss_legendre(32), fine = gauss_legendre(128);
  RoughTransmittance table;
  std::array<double, kTransmittanceResolution> reflected{};
  parallel_for(kTransmittanceResolution, [&](std::size_t i) {
    const float cos = std::fmax(1e-6f, static_cast<float>(i) / static_cast<float>(kTransmittanceResolution - 1));
    table.external[i] = static_cast<float>(integrate(microfacet, coarse, cos, eta, true));
    reflected[i] = integrate(microfacet, fine, cos, 1.0f / eta, false) * static_cast<double>(cos);
  });
  double sum = 0.0;
  for (const double r : reflected) sum += r;
  table.internal_reflectance = static_cast<float>(2.0 * sum / kTransmittanceResolution);
  return table;
}

}  // namespace octrad
