// Curves as tubes; their agreement with Mitsuba's is tested in geometry/mitsuba_shapes_test.cc.
#include "octrad/scene/curves.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "octrad/base/error.h"

namespace octrad {
namespace {

constexpr double kCircle = 2.0 * std::numbers::pi;

RawMesh tubes(const std::string& text, CurveKind kind, const Transform& to_world = {}) {
  return make_curves(parse_curves("c.txt", text, kind), kind, to_world);
}

double surface_of(const RawMesh& mesh) {
  double sum = 0.0;
  for (const Vec3i& t : mesh.triangles) {
    const Vec3d p(mesh.positions[static_cast<std::size_t>(t.x)]), a(mesh.positions[static_cast<std::size_t>(t.y)]),
        b(mesh.positions[static_cast<std::size_t>(t.z)]);
    sum += 0.5 * length(cross(a - p, b - p));
  }
  return sum;
}

std::string curve_error(const std::string& text, CurveKind kind = CurveKind::linear) {
  try {
    parse_curves("c.txt", text, kind);
  } catch (const Error& e) {
    return e.what();
  }
  return "no error";
}

TEST(Curves, AreasOfStraightOnes) {
  const double whole = kCircle * 0.25 * 2.0 + 2.0 * kCircle * 0.25 * 0.25;
  EXPECT_NEAR(surface_of(tubes("0 0 0 .25\n0 2 0 .25\n", CurveKind::linear)), whole, 2e-3 * whole);
  // The same in three parts; one of them has no length.
  EXPECT_NEAR(surface_of(tubes("0 0 0 .25\n0 .5 0 .25\n0 .5 0 .25\n0 2 0 .25", CurveKind::linear)), whole,
              2e-3 * whole);
  // A cone between spheres of 0.5 and 0.25, 2 apart: by the latitude where it touches them.
  const double touch = std::asin(0.125), slant = 2.0 * std::cos(touch), mean = 0.375 * std::cos(touch);
  const double cone =
      kCircle * mean * slant + kCircle * 0.25 * (1.0 + std::sin(touch)) + kCircle * 0.0625 * (1.0 - std::sin(touch));
  EXPECT_NEAR(surface_of(tubes("1 1 1 .5\n3 1 1 .25\n", CurveKind::linear)), cone, 2e-3 * cone);
  // Radii that swell where the points lie on a line: the cubic's, not a chord's.
  double widest = 0.0;
  const RawMesh bump = tubes("0 0 0 .1\n0 0 1 .1\n0 0 2 1\n0 0 3 .1\n0 0 4 .1\n", CurveKind::bspline);
  for (const Vec3f& p : bump.positions)
    if (std::fabs(p.z - 1.5f) < 0.06f)
      widest = std::max(widest, std::hypot(static_cast<double>(p.x), static_cast<double>(p.y)));
  EXPECT_NEAR(widest, 0.531, 0.05);
  // Of a B-spline what lies between the second and the last but one point, open.
  const double open = kCircle * 0.25 * 2.0;
  EXPECT_NEAR(surface_of(tubes("0 0 -1 .25\n0 0 0 .25\n0 0 1 .25\n0 0 2 .25\n0 0 3 .25", CurveKind::bspline)), open,
              1e-3 * open);
}

TEST(Curves, RadiiDoNotFollowTheTransform) {
  const RawMesh mesh = tubes("0 0 0 .25\r\n0 1 0 .25\r\n", CurveKind::linear, Transform::scale({4, 2, 4}));
  double widest = 0.0, highest = 0.0;
  for (const Vec3f& p : mesh.positions) {
    widest = std::max(widest, std::hypot(static_cast<double>(p.x), static_cast<double>(p.z)));
    highest = std::max(highest, static_cast<double>(p.y));
  }
  EXPECT_NEAR(widest, 0.25, 1e-3);
  EXPECT_NEAR(highest, 2.25, 1e-3);
}

TEST(Curves, FaceOutwards) {
  for (const CurveKind kind : {CurveKind::linear, CurveKind::bspline}) {
    const RawMesh mesh = tubes("0 0 0 .1\n1 0 .3 .2\n2 1 0 .1\n2.5 2 .2 .3\n3 2 0 .1\n", kind);
    ASSERT_EQ(mesh.normals.size(), mesh.positions.size());
    std::size_t inwards = 0;
    for (const Vec3i& t : mesh.triangles) {
      Vec3d p[3], normals(0.0);
      for (int k = 0; k < 3; ++k) {
        p[k] = Vec3d(mesh.positions[static_cast<std::size_t>(t[k])]);
        normals += normalize(Vec3d(mesh.normals[static_cast<std::size_t>(t[k])]));
      }
      const Vec3d n = cross(p[1] - p[0], p[2] - p[0]);
      inwards += length(n) > 1e-9 && dot(normalize(n), normalize(normals)) < 0.8;
    }
    // Where a linear curve turns, parts of spheres are folded within the tube on the inner side.
    EXPECT_LE(inwards, kind == CurveKind::linear ? mesh.triangles.size() / 4 : 0u);
  }
}

// Texture coordinates say everywhere where the curve runs, at ends and turns as well.
TEST(Curves, CoordinatesRunAlong) {
  for (const CurveKind kind : {CurveKind::linear, CurveKind::bspline}) {
    const RawMesh mesh = tubes("0 0 0 .1\n1 0 .3 .2\n2 1 0 .1\n2.5 2 .2 .3\n3 2 0 .1\n", kind);
    for (const Vec3i& t : mesh.triangles) {
      const Vec2f a = mesh.uvs[static_cast<std::size_t>(t.x)], b = mesh.uvs[static_cast<std::size_t>(t.y)],
                  c = mesh.uvs[static_cast<std::size_t>(t.z)];
      const Vec2f d = b - a, e = c - a;
      EXPECT_GT(std::fabs(d.x * e.y - d.y * e.x), 1e-9f);
      EXPECT_TRUE(b.y >= -1e-6f && b.y <= 1.0f + 1e-6f);
    }
  }
}

// Strands of hair: fewer sides.
TEST(Curves, ManyPoints) {
  std::string text;
  for (int i = 0; i < 20000; ++i) {
    const std::string x = std::to_string(i);
    for (int k = 0; k < 10; ++k) text += x + " " + std::to_string(k) + " 0 " + (k == 9 ? "0" : ".1") + "\n";
    text += "\n";
  }
  const RawMesh mesh = tubes(text, CurveKind::bspline);
  EXPECT_GT(mesh.triangles.size(), 1'000'000u);
  EXPECT_LT(mesh.triangles.size(), 6'000'000u);
}

TEST(Curves, WhatIsLeftOut) {
  EXPECT_TRUE(tubes("1 1 1 .5\n1 1 1 .25\n", CurveKind::linear).triangles.empty());
  EXPECT_TRUE(tubes("1 1 1 1\n1 1 1 1\n1 1 1 1\n1 1 1 1\n", CurveKind::bspline).triangles.empty());
  // A sphere within another one.
  EXPECT_GT(surface_of(tubes("0 0 0 1\n0 .1 0 .1\n", CurveKind::linear)), 0.9 * 2.0 * kCircle);
  // Too far away for anything: refused where it is placed.
  for (const CurveKind kind : {CurveKind::linear, CurveKind::bspline})
    EXPECT_THROW(place_mesh(tubes("-1e308 0 0 1\n1e308 1 0 1\n0 1e308 0 1\n0 0 -1e308 1e308\n", kind), Transform(), {}),
                 InputError);
  // There and back.
  for (const Vec3f& n : tubes("0 0 0 .1\n1 0 0 .1\n0 0 0 .1\n", CurveKind::linear).normals)
    EXPECT_TRUE(std::isfinite(n.x) && std::isfinite(n.y) && std::isfinite(n.z));
}

TEST(Curves, Parsing) {
  const auto curves = parse_curves("c.txt", "\n  1 2 3 4 5\n\t+1e-1 -2 .3 0\n \n\n5 6 7 8\n9 9 9 9", CurveKind::linear);
  ASSERT_EQ(curves.size(), 2u);
  EXPECT_EQ(curves[0].size(), 2u);
  EXPECT_EQ(curves[0][1].position, Vec3d(0.1, -2, 0.3));
  EXPECT_EQ(curves[1][1].radius, 9.0);
  EXPECT_EQ(curve_error(""), "c.txt:1:1: the file holds no curve");
  EXPECT_EQ(curve_error("1 2 3\n"), "c.txt:1:6: control point: expected a number (x y z radius)");
  EXPECT_EQ(curve_error("1 2 3 4\n1 2 x 4\n"), "c.txt:2:5: control point: expected a number (x y z radius)");
  EXPECT_EQ(curve_error("1 2 inf 4\n"), "c.txt:1:5: control point: the number is not finite");
  EXPECT_EQ(curve_error("1 1e999 1 4\n"), "c.txt:1:3: control point: the number is not finite");
  EXPECT_EQ(curve_error("1 2 3 -4\n"), "c.txt:1:7: control point: the radius is negative");
  EXPECT_EQ(curve_error("1 2 3 4\n\n1 2 3 4\n2 2 2 2"),
            "c.txt:2:1: the curve before this has 1 control points: it needs 2");
  EXPECT_EQ(curve_error("1 2 3 4\n1 2 3 5\n2 2 2 2", CurveKind::bspline),
            "c.txt:3:8: the curve before this has 3 control points: it needs 4");
}

}  // namespace
}  // namespace octrad
