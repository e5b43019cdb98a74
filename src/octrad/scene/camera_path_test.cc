// The spline against its definition, and what cameras on it see. Files and their errors: tests/cli/test_camera_path.py.
#include "octrad/scene/camera_path.h"

#include <gtest/gtest.h>

#include <cmath>

#include "octrad/scene/files_test_helper.h"

namespace octrad {
namespace {

SplinePoint point(double a, double b = 0.0) { return {a, b}; }

TEST(CameraPath, SplineGoesThroughItsPoints) {
  const std::vector<SplinePoint> points = {point(1, 2), point(4, -1), point(-2, 0), point(5, 5)};
  const std::vector<double> knots = {0.0, 1.5, 1.75, 4.0};
  for (std::size_t i = 0; i < points.size(); ++i) {
    const SplinePoint p = evaluate_spline(points, knots, knots[i]);
    for (std::size_t c = 0; c < p.size(); ++c) EXPECT_NEAR(p[c], points[i][c], 1e-12);
  }
}

// Catmull-Rom reproduces polynomials up to the second degree between inner knots, and straight lines everywhere.
TEST(CameraPath, SplineReproducesPolynomials) {
  const std::vector<double> knots = {0.0, 0.7, 1.0, 2.2, 3.0};
  std::vector<SplinePoint> points;
  for (const double t : knots) points.push_back(point(3.0 - 2.0 * t, 1.0 + t - 0.5 * t * t));
  for (double t = 0.0; t <= 3.0; t += 0.05) {
    const SplinePoint p = evaluate_spline(points, knots, t);
    EXPECT_NEAR(p[0], 3.0 - 2.0 * t, 1e-12);
    if (t >= 0.7 && t <= 2.2) {
      EXPECT_NEAR(p[1], 1.0 + t - 0.5 * t * t, 1e-12) << t;
    }
  }
}

TEST(CameraPath, SplineIsSmoothAtItsPoints) {
  const std::vector<SplinePoint> points = {point(1, 2), point(4, -1), point(-2, 0), point(5, 5)};
  const std::vector<double> knots = {0.0, 1.5, 1.75, 4.0};
  for (const double knot : {1.5, 1.75}) {
    const double h = 1e-6;
    for (std::size_t c = 0; c < 2; ++c) {
      const double before = evaluate_spline(points, knots, knot)[c] - evaluate_spline(points, knots, knot - h)[c];
      const double after = evaluate_spline(points, knots, knot + h)[c] - evaluate_spline(points, knots, knot)[c];
      EXPECT_NEAR(before / h, after / h, 1e-3);
    }
  }
}

CameraPath path_of(const std::string& json) {
  TestFolder folder;
  return CameraPath(folder.write("path.json", json));
}

TEST(CameraPath, TwoKeysAreAStraightWayOfConstantSpeed) {
  const CameraPath path = path_of(R"({"frames": 5, "keys": [{"origin": [0, 0, 4], "target": [0, 0, 0], "fov": 40},
                                                            {"origin": [4, 0, 4], "target": [4, 0, 0], "fov": 60}]})");
  ASSERT_EQ(path.frames(), 5);
  for (int f = 0; f < 5; ++f) {
    const Camera camera = path.camera(f);
    EXPECT_NEAR(camera.origin.x, static_cast<float>(f), 1e-5f);
    EXPECT_NEAR(camera.fov_degrees, 40.0f + 5.0f * static_cast<float>(f), 1e-4f);
    EXPECT_NEAR(camera.forward.z, -1.0f, 1e-6f);
  }
}

TEST(CameraPath, ATargetOfAllKeysStaysInTheCentre) {
  const CameraPath path = path_of(R"({"duration": 2, "fps": 10, "keys": [
      {"origin": [3, 1, 0], "target": [0, 0.5, 0]}, {"origin": [0, 2, 3], "target": [0, 0.5, 0]},
      {"origin": [-3, 1, 1], "target": [0, 0.5, 0]}]})");
  ASSERT_EQ(path.frames(), 21);
  for (int f = 0; f < path.frames(); ++f) {
    const Camera camera = path.camera(f);
    EXPECT_LT(length(normalize(Vec3f(0, 0.5f, 0) - camera.origin) - camera.forward), 1e-5f) << f;
    EXPECT_NEAR(dot(camera.up, camera.right), 0.0f, 1e-6f);
  }
}

// With "to_world" the camera turns on the spot; the frames in between look between.
TEST(CameraPath, TurnsOnTheSpot) {
  const CameraPath path = path_of(R"({"frames": 3, "keys": [
      {"to_world": [1, 0, 0, 5, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]},
      {"to_world": [0, 0, 1, 5, 0, 1, 0, 0, -1, 0, 0, 0, 0, 0, 0, 1]}]})");
  EXPECT_NEAR(path.camera(0).forward.z, 1.0f, 1e-6f);
  EXPECT_NEAR(path.camera(1).forward.x, std::sqrt(0.5f), 1e-5f);
  EXPECT_NEAR(path.camera(2).forward.x, 1.0f, 1e-6f);
  for (int f = 0; f < 3; ++f) EXPECT_EQ(path.camera(f).origin.x, 5.0f);
}

}  // namespace
}  // namespace octrad
