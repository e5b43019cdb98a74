// For tests: chi-square goodness of fit of directional samplers.
#pragma once

#include <cmath>
#include <functional>
#include <string>
#include <vector>

#include "octrad/base/rng.h"

namespace octrad::testing {

// Probability that a chi-square variable of `dof` degrees of freedom exceeds x (Wilson & Hilferty 1931).
inline double chi_square_tail(double x, int dof) {
  const double k = dof;
  const double z = (std::cbrt(x / k) - (1.0 - 2.0 / (9.0 * k))) / std::sqrt(2.0 / (9.0 * k));
  return 0.5 * std::erfc(z / std::sqrt(2.0));
}

struct ChiSquareResult {
  double p_value = 0.0;
  double integral = 0.0;  // of the density
  double share = 0.0;     // of samples that were valid
  std::string text;
};

// Compares `samples` draws with the density integrated over cells of equal area on the sphere. A draw returns false
// when it gives no direction (delta lobe, absorbed). Cells that expect fewer than 5 draws are pooled.
inline ChiSquareResult chi_square(const std::function<bool(Rng&, Vec3f&)>& draw,
                                  const std::function<double(Vec3f)>& density, int samples, std::uint64_t seed,
                                  int rows = 24, int columns = 36, int quadrature = 12) {
  const auto cells = static_cast<std::size_t>(rows * columns);
  std::vector<double> expected(cells), observed(cells);
  const double cell_area = 4.0 * 3.14159265358979 / static_cast<double>(cells);
  ChiSquareResult result;
  for (std::size_t i = 0; i < cells; ++i) {
    double sum = 0.0;
    for (int a = 0; a < quadrature; ++a) {
      for (int b = 0; b < quadrature; ++b) {
        const double z =
            1.0 - 2.0 * (static_cast<double>(i / static_cast<std::size_t>(columns)) + (a + 0.5) / quadrature) / rows;
        const double phi = 2.0 * 3.14159265358979 *
                           (static_cast<double>(i % static_cast<std::size_t>(columns)) + (b + 0.5) / quadrature) /
                           columns;
        const double r = std::sqrt(std::fmax(0.0, 1.0 - z * z));
        sum += density(
            Vec3f(static_cast<float>(r * std::cos(phi)), static_cast<float>(r * std::sin(phi)), static_cast<float>(z)));
      }
    }
    const double share = sum / (quadrature * quadrature) * cell_area;
    expected[i] = share * samples;
    result.integral += share;
  }
  Rng rng(seed, RngPurpose::test, 0);
  int valid = 0;
  for (int i = 0; i < samples; ++i) {
    Vec3f w;
    if (!draw(rng, w)) continue;
    ++valid;
    double phi = std::atan2(static_cast<double>(w.y), static_cast<double>(w.x));
    if (phi < 0.0) phi += 2.0 * 3.14159265358979;
    const auto row =
        static_cast<std::size_t>(std::fmin(rows - 1, std::fmax(0.0, (1.0 - static_cast<double>(w.z)) * 0.5 * rows)));
    const auto column = static_cast<std::size_t>(std::fmin(columns - 1, phi / (2.0 * 3.14159265358979) * columns));
    observed[row * static_cast<std::size_t>(columns) + column] += 1.0;
  }
  result.share = static_cast<double>(valid) / samples;
  double statistic = 0.0, pooled_expected = 0.0, pooled_observed = 0.0;
  int dof = -1;
  for (std::size_t i = 0; i < cells; ++i) {
    if (expected[i] < 5.0) {
      pooled_expected += expected[i];
      pooled_observed += observed[i];
      continue;
    }
    statistic += (observed[i] - expected[i]) * (observed[i] - expected[i]) / expected[i];
    ++dof;
  }
  if (pooled_expected >= 5.0) {
    statistic += (pooled_observed - pooled_expected) * (pooled_observed - pooled_expected) / pooled_expected;
    ++dof;
  } else if (pooled_observed > pooled_expected + 25.0) {
    statistic += 1e6;  // draws where the density is zero
  }
  result.p_value = dof > 0 ? chi_square_tail(statistic, dof) : 0.0;
  result.text = "chi2 " + std::to_string(statistic) + " with " + std::to_string(dof) + " degrees of freedom, p " +
                std::to_string(result.p_value) + ", density integrates to " + std::to_string(result.integral);
  return result;
}

}  // namespace octrad::testing
