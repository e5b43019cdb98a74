#include <gtest/gtest.h>

#include <cmath>

#include "octrad/base/rng.h"
#include "octrad/model/ncr_math.h"

namespace octrad {
namespace {

// D of GGX over the angle, Walter et al. 2007, equation 33.
double ggx(double alpha, double theta) {
  const double c2 = std::cos(theta) * std::cos(theta), e = c2 * (alpha * alpha - 1.0) + 1.0;
  return alpha * alpha / (3.14159265358979323846 * e * e);
}

// By Simpson's rule in s with theta = s^3, which resolves the peak at 0.
double integral(double alpha, double end) {
  constexpr int kSteps = 20000;
  const double top = std::cbrt(end), h = top / kSteps;
  double sum = 0.0;
  for (int i = 0; i <= kSteps; ++i) {
    const double s = i * h, weight = i == 0 || i == kSteps ? 1.0 : (i % 2 == 1 ? 4.0 : 2.0);
    sum += weight * ggx(alpha, s * s * s) * 3.0 * s * s;
  }
  return sum * h / 3.0;
}

TEST(Lobe, TheAngleHoldsItsShareOfTheDistribution) {
  for (const double share : {0.5, 0.9, 0.99}) {
    for (const double alpha : {0.01, 0.05, 0.1, 0.3, 0.5, 0.8, 1.0}) {
      const double theta = std::atan(lobe_tangent_exact(alpha, share));
      EXPECT_NEAR(integral(alpha, theta) / integral(alpha, 0.5 * 3.14159265358979323846), share, 1e-6)
          << alpha << " " << share;
    }
  }
}

TEST(Lobe, TableFollowsTheAngle) {
  const LobeTable table = lobe_table(0.99);
  EXPECT_EQ(table(0.0f), 0.0f);
  EXPECT_EQ(table(-1.0f), 0.0f);
  EXPECT_EQ(table(2.0f), table(1.0f));
  float before = 0.0f;
  for (double alpha = 0.0; alpha < 1.0; alpha += 0.0013) {
    const double expected = lobe_tangent_exact(alpha, 0.99);
    EXPECT_NEAR(table(static_cast<float>(alpha)), expected, 1e-3 * expected + 1e-7) << alpha;
    EXPECT_GE(table(static_cast<float>(alpha)), before);
    before = table(static_cast<float>(alpha));
  }
}

TEST(Cone, EndsAtItsClusterWithTheMeanOfLobeAndSpread) {
  SurfacePoint point;
  point.x = {1, 2, 3};
  const ConeEnd end = cone_end(point, {0, 0, -1}, {4.0f, 0.5f, 0.25f}, 0.25f);
  EXPECT_EQ(end.x, Vec3f(1, 2, -1));
  EXPECT_FLOAT_EQ(end.r, 0.75f);  // (4 * 0.25 + 0.5) / 2
}

TEST(Chroma, GradientIsThatOfTheValue) {
  Rng rng(1, RngPurpose::test, 41);
  for (int trial = 0; trial < 100; ++trial) {
    const auto color = [&] {
      return Vec3d(static_cast<double>(rng.uniform()), static_cast<double>(rng.uniform()),
                   static_cast<double>(rng.uniform())) *
             4.0;
    };
    const Vec3d prediction = color(), target = color();
    const double epsilon = 0.05, h = 1e-6;
    const ChromaTerm<double> term = chroma_loss(prediction, target, epsilon);
    // From the definition.
    double value = 0.0;
    for (int c = 0; c < 3; ++c) {
      const double d = prediction[c] / (length(prediction) + epsilon) - target[c] / (length(target) + epsilon);
      value += d * d;
    }
    EXPECT_NEAR(term.value, value, 1e-12);
    for (int c = 0; c < 3; ++c) {
      Vec3d up = prediction, down = prediction;
      up[c] += h;
      down[c] -= h;
      const double difference =
          (chroma_loss(up, target, epsilon).value - chroma_loss(down, target, epsilon).value) / (2 * h);
      EXPECT_NEAR(term.gradient[c], difference, 1e-7);
    }
  }
}

TEST(Chroma, DoesNotSeeBrightness) {
  const Vec3d color(2.0, 1.0, 0.5);
  EXPECT_NEAR(chroma_loss(color * 1e6, color * 1e5, 1e-3).value, 0.0, 1e-12);
  EXPECT_GT(chroma_loss(Vec3d(1.0, 1.0, 1.0), Vec3d(1.0, 0.1, 0.1), 1e-3).value, 0.1);
  const ChromaTerm<double> black = chroma_loss(Vec3d(0.0), color, 0.1);
  EXPECT_TRUE(std::isfinite(black.value) && std::isfinite(black.gradient.x));
}

}  // namespace
}  // namespace octrad
