#include <gtest/gtest.h>

#include "octrad/encoding/spherical_harmonics_math.h"

namespace octrad {
namespace {

double factorial(int n) { return n < 2 ? 1.0 : n * factorial(n - 1); }

TEST(SphericalHarmonics, OrthonormalByQuadrature) {
  // Products of two have degree <= 6: 4 Gauss-Legendre nodes in z (exact to degree 7) and 16 equal steps in phi are
  // exact.
  const double node[2] = {0.86113631159405257522, 0.33998104358485626480},
               gauss[2] = {0.34785484513745385737, 0.65214515486254614263};
  double gram[16][16] = {};
  for (int a = 0; a < 4; ++a) {
    const double z = (a < 2 ? 1.0 : -1.0) * node[a & 1], r = std::sqrt(1.0 - z * z);
    for (int k = 0; k < 16; ++k) {
      const double phi = 2.0 * 3.14159265358979323846 * (k + 0.25) / 16;
      double y[16];
      spherical_harmonics(Vec3d{r * std::cos(phi), r * std::sin(phi), z}, y);
      for (int i = 0; i < 16; ++i) {
        for (int j = 0; j < 16; ++j) gram[i][j] += gauss[a & 1] * 2.0 * 3.14159265358979323846 / 16 * y[i] * y[j];
      }
    }
  }
  for (int i = 0; i < 16; ++i) {
    for (int j = 0; j < 16; ++j) EXPECT_NEAR(gram[i][j], i == j ? 1.0 : 0.0, 1e-12) << i << ' ' << j;
  }
}

TEST(SphericalHarmonics, MatchTheFormula) {
  for (double z : {-0.9, -0.2, 0.3, 0.77}) {
    for (double phi : {0.3, 2.0, 4.4}) {
      const double r = std::sqrt(1.0 - z * z);
      double y[16];
      spherical_harmonics(Vec3d{r * std::cos(phi), r * std::sin(phi), z}, y);
      for (int l = 0; l < 4; ++l) {
        for (int m = -l; m <= l; ++m) {
          const int a = std::abs(m);
          const double norm =
              std::sqrt((2 * l + 1) / (4 * 3.14159265358979323846) * factorial(l - a) / factorial(l + a));
          // std::assoc_legendre leaves the Condon-Shortley phase out.
          const double legendre =
              std::assoc_legendre(static_cast<unsigned>(l), static_cast<unsigned>(a), z) * (a % 2 ? -1.0 : 1.0);
          const double azimuth = m == 0 ? 1.0 : std::sqrt(2.0) * (m > 0 ? std::cos(a * phi) : std::sin(a * phi));
          EXPECT_NEAR(y[l * (l + 1) + m], norm * legendre * azimuth, 1e-12) << l << ' ' << m;
        }
      }
    }
  }
}

TEST(SphericalHarmonics, Stride) {
  float packed[16], strided[16 * 5] = {};
  const Vec3f w = normalize(Vec3f{0.3f, -0.5f, 0.2f});
  spherical_harmonics(w, packed);
  spherical_harmonics(w, strided, 5);
  for (int i = 0; i < 16; ++i) EXPECT_EQ(packed[i], strided[i * 5]);
}

}  // namespace
}  // namespace octrad
