#include "octrad/encoding/planes.h"

#include <gtest/gtest.h>

#include <cmath>

#include "octrad/base/error.h"
#include "octrad/base/rng.h"

namespace octrad {
namespace {

Planes random_planes(int resolution, int features) {
  Planes planes(resolution, features);
  Rng rng(1, RngPurpose::test, 0);
  for (float& v : planes.table()) v = rng.uniform() - 0.5f;
  return planes;
}

std::vector<Vec3f> positions() {
  std::vector<Vec3f> p = {{0, 0, 0}, {1, 1, 1}, {0.5f, 0, 1}, {-1, 2, 0.3f}};
  Rng rng(2, RngPurpose::test, 0);
  for (int i = 0; i < 60; ++i) p.push_back({rng.uniform(), rng.uniform(), rng.uniform()});
  return p;
}

// Bilinear interpolation written out, in double.
double expected(const Planes& planes, Vec3f p, int feature) {
  const int r = planes.resolution();
  double sum = 0.0;
  for (int a = 0; a < 3; ++a) {
    const auto coordinate = [&](int axis) {
      return std::fmin(1.0, std::fmax(0.0, static_cast<double>(p[axis % 3]))) * (r - 1);
    };
    for (int y = 0; y < r; ++y) {
      for (int x = 0; x < r; ++x) {
        const double wx = std::fmax(0.0, 1.0 - std::fabs(coordinate(a) - x)),
                     wy = std::fmax(0.0, 1.0 - std::fabs(coordinate(a + 1) - y));
        sum += wx * wy *
               static_cast<double>(
                   planes.table()[static_cast<std::size_t>(((a * r + y) * r + x) * planes.features() + feature)]);
      }
    }
  }
  return sum;
}

TEST(Planes, InterpolateBilinearly) {
  const Planes planes = random_planes(7, 3);
  const std::vector<Vec3f> p = positions();
  std::vector<float> out(3 * p.size());
  planes.lookup(p.data(), static_cast<int>(p.size()), out.data(), static_cast<int>(p.size()), nullptr);
  for (std::size_t i = 0; i < p.size(); ++i) {
    for (int f = 0; f < 3; ++f)
      EXPECT_NEAR(out[static_cast<std::size_t>(f) * p.size() + i], expected(planes, p[i], f), 2e-6) << i;
  }
}

// The derivative with respect to a table entry is the sum of the weights of its taps.
TEST(Planes, GradientsAgreeWithCentralDifferences) {
  Planes planes = random_planes(5, 1);
  for (const Vec3f p : positions()) {
    std::vector<Tap> taps(kPlaneTaps);
    float out = 0.0f;
    planes.lookup(&p, 1, &out, 1, taps.data());
    for (std::size_t e = 0; e < planes.table().size(); ++e) {
      double gradient = 0.0;
      for (const Tap& tap : taps) gradient += tap.entry == e ? static_cast<double>(tap.weight) : 0.0;
      const float kept = planes.table()[e];
      planes.table()[e] = kept + 1.0f;
      const double more = expected(planes, p, 0);
      planes.table()[e] = kept - 1.0f;
      const double less = expected(planes, p, 0);
      planes.table()[e] = kept;
      EXPECT_NEAR(gradient, 0.5 * (more - less), 1e-6);
    }
  }
}

TEST(Planes, RefuseOptionsOutOfRange) {
  EXPECT_THROW(Planes(1, 4), InputError);
  EXPECT_THROW(Planes(8, 0), InputError);
}

}  // namespace
}  // namespace octrad
