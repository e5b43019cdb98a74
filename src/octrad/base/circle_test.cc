#include <gtest/gtest.h>

#include <cmath>

#include "octrad/base/circle_math.h"

namespace octrad {
namespace {

TEST(Circle, PointsAreCosinesAndSines) {
  for (int i = 0; i <= 12000; ++i) {
    const float u = static_cast<float>(i) / 10000.0f;
    const double phi = 2.0 * 3.14159265358979323846 * static_cast<double>(u);
    EXPECT_NEAR(circle_point(u).x, std::cos(phi), 4e-7) << u;
    EXPECT_NEAR(circle_point(u).y, std::sin(phi), 4e-7) << u;
  }
}

TEST(Circle, ArcsAreWithinAnEighthOfATurn) {
  for (int i = -5000; i <= 5000; ++i) {
    const float angle = static_cast<float>(i) / 5000.0f * 0.25f * kPi;
    EXPECT_NEAR(arc_point(angle).x, std::cos(static_cast<double>(angle)), 1e-7) << angle;
    EXPECT_NEAR(arc_point(angle).y, std::sin(static_cast<double>(angle)), 1e-7) << angle;
  }
}

}  // namespace
}  // namespace octrad
