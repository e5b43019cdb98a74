// Our tree against every triangle in double, against Embree, and for what must hold of its structure.
#include "octrad/geometry/bvh8.h"

#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <limits>

#include "octrad/base/rng.h"
#include "octrad/base/threads.h"
#include "octrad/geometry/surface_sampling.h"
#include "octrad/scene/files_test_helper.h"
#include "octrad/scene/load.h"

namespace octrad {
namespace {

constexpr float kFar = 1e30f;
constexpr double kTie = 1e-4;  // relative distance within which two surfaces are one

Vec3f random_point(Rng& rng, float size) {
  return {size * (rng.uniform() - 0.5f), size * (rng.uniform() - 0.5f), size * (rng.uniform() - 0.5f)};
}

void add_mesh(Scene& scene, const TriangleMesh& mesh) {
  Shape shape;
  shape.geometry = static_cast<int>(scene.meshes.size());
  scene.meshes.push_back(mesh);
  scene.shapes.push_back(shape);
}

void add_sphere(Scene& scene, Vec3f center, float radius) {
  Shape shape;
  shape.kind = Shape::Kind::sphere;
  shape.geometry = static_cast<int>(scene.spheres.size());
  Sphere sphere;
  sphere.center = center;
  sphere.radius = radius;
  scene.spheres.push_back(sphere);
  scene.shapes.push_back(shape);
}

void add_triangle(TriangleMesh& mesh, Vec3f a, Vec3f b, Vec3f c) {
  const int first = static_cast<int>(mesh.positions.size());
  mesh.positions.insert(mesh.positions.end(), {a, b, c});
  mesh.triangles.push_back({first, first + 1, first + 2});
}

Scene soup(int triangles, float size, std::uint64_t seed) {
  Scene scene;
  TriangleMesh mesh;
  Rng rng(seed, RngPurpose::test, 0);
  for (int i = 0; i < triangles; ++i) {
    const Vec3f p = random_point(rng, 2.0f);
    add_triangle(mesh, p, p + random_point(rng, size), p + random_point(rng, size));
  }
  add_mesh(scene, mesh);
  return scene;
}

// What a primitive says of a ray in double (Moeller & Trumbore 1997; the quadratic). `margin`: the smallest barycentric
// coordinate, of which the sign decides; for spheres the share of the radius that the line is inside. `t_error` and
// `margin_error`: what rounding of the corners in float may change of them.
struct Exact {
  double t = -1.0, margin = -1.0, t_error = 0.0, margin_error = 0.0;
};

Exact exact_triangle(Vec3d p0, Vec3d p1, Vec3d p2, Vec3d o, Vec3d d) {
  const Vec3d e1 = p1 - p0, e2 = p2 - p0, p = cross(d, e2), s = o - p0, q = cross(s, e1);
  const double det = dot(e1, p);
  if (det == 0.0) return {};
  const double u = dot(s, p) / det, v = dot(d, q) / det;
  const double reach = std::max({length(s), length(p1 - o), length(p2 - o)}), area = length(cross(e1, e2));
  const double error = 32.0 * 0x1p-24 * reach * area / std::fabs(det) * length(d);  // over the sine
  const double height = area / std::max({length(e1), length(e2), length(p2 - p1)});
  return {dot(e2, q) / det, std::min({u, v, 1.0 - u - v}), error / length(d), error / height};
}

Exact exact_triangle(const TriangleMesh& m, std::size_t i, Vec3f origin, Vec3f direction) {
  const Vec3i t = m.triangles[i];
  const auto at = [&](int k) { return Vec3d(m.positions[static_cast<std::size_t>(t[k])]); };
  return exact_triangle(at(0), at(1), at(2), Vec3d(origin), Vec3d(direction));
}

// The result must be a primitive that the ray meets or touches, and no primitive that it clearly meets may be nearer.
void expect_correct(const Scene& scene, const Tracer& tracer, Vec3f origin, Vec3f direction, float t_min, float t_max,
                    const char* what) {
  constexpr double kMargin = 1e-4;
  const Hit hit = tracer.intersect(origin, direction, t_min, t_max);
  const double near_limit = static_cast<double>(t_min), far_limit = static_cast<double>(t_max);
  double certain = std::numeric_limits<double>::infinity();
  bool possible = false;
  const auto consider = [&](Exact e, int shape, int primitive) {
    const double tolerance = kTie * std::max(1e-2, std::fabs(e.t)) + e.t_error, margin = kMargin + e.margin_error;
    if (e.margin > margin && e.t > near_limit + tolerance && e.t < far_limit - tolerance)
      certain = std::min(certain, e.t + tolerance);
    if (hit.shape == shape && hit.primitive == primitive) {
      possible = e.margin > -margin && std::fabs(e.t - static_cast<double>(hit.t)) <= tolerance && hit.t >= t_min &&
                 hit.t <= t_max;
    }
  };
  for (std::size_t s = 0; s < scene.shapes.size(); ++s) {
    const auto geometry = static_cast<std::size_t>(scene.shapes[s].geometry);
    if (scene.shapes[s].kind == Shape::Kind::sphere) {
      const Sphere& sphere = scene.spheres[geometry];
      const Vec3d o = Vec3d(origin) - Vec3d(sphere.center), d(direction);
      const double r = static_cast<double>(sphere.radius), a = dot(d, d), b = dot(o, d) / a,
                   h = b * b - (dot(o, o) - r * r) / a;
      for (const double root : {-1.0, 1.0}) {
        const Exact e{-b + root * std::sqrt(std::max(0.0, h)), h * a / (r * r)};
        const bool done = possible;
        consider(e, static_cast<int>(s), 0);
        possible = possible || done;
      }
      continue;
    }
    const TriangleMesh& m = scene.meshes[geometry];
    for (std::size_t i = 0; i < m.triangles.size(); ++i)
      consider(exact_triangle(m, i, origin, direction), static_cast<int>(s), static_cast<int>(i));
  }
  if (hit.valid()) {
    EXPECT_TRUE(possible) << what << " t " << hit.t;
    EXPECT_LE(static_cast<double>(hit.t), certain) << what;
  } else {
    EXPECT_EQ(certain, std::numeric_limits<double>::infinity()) << what;
  }
  EXPECT_EQ(tracer.occluded(origin, direction, t_min, t_max), hit.valid()) << what;
}

TEST(Bvh8, AgreesWithBruteForceInSoups) {
  for (const float size : {2.0f, 0.3f, 0.02f}) {
    for (const int triangles : {1, 2, 3, 5, 9, 40, 1000}) {
      const Scene scene = soup(triangles, size, static_cast<std::uint64_t>(triangles));
      const auto tracer = make_bvh8_tracer(scene);
      Rng rng(7, RngPurpose::test, 0);
      for (int i = 0; i < 400; ++i) {
        Vec3f direction = uniform_direction(rng.uniform2());
        const Vec3f origin = random_point(rng, i % 4 == 0 ? 20.0f : 3.0f);
        // Half of the rays aim at a triangle; some have another length.
        if (i % 2 == 0) {
          const TriangleMesh& m = scene.meshes[0];
          const Vec3i t = m.triangles[rng.below(static_cast<std::uint32_t>(triangles))];
          const auto at = [&](int k) { return m.positions[static_cast<std::size_t>(t[k])]; };
          direction = normalize((at(0) + at(1) + at(2)) / 3.0f - origin);
        }
        if (i % 5 == 0) direction = direction * 37.5f;
        const float t_min = i % 3 == 0 ? rng.uniform() : 0.0f, t_max = i % 7 == 0 ? 2.0f * rng.uniform() : kFar;
        expect_correct(scene, *tracer, origin, direction, t_min, t_max, "soup");
      }
    }
  }
}

TEST(Bvh8, AxisParallelRays) {
  Scene scene = soup(300, 0.5f, 3);
  add_sphere(scene, {0.2f, 0.1f, 0.0f}, 0.4f);
  const auto tracer = make_bvh8_tracer(scene);
  Rng rng(8, RngPurpose::test, 0);
  for (int i = 0; i < 1200; ++i) {
    const float zeros[4] = {0.0f, -0.0f, 1e-40f, -1e-12f};
    Vec3f direction{zeros[rng.below(4)], zeros[rng.below(4)], zeros[rng.below(4)]};
    direction[i % 3] = i % 2 == 0 ? 1.0f : -1.0f;
    if (i % 5 == 0) direction[(i + 1) % 3] = 0.5f;
    Vec3f origin = random_point(rng, 2.0f);
    if (i % 4 == 0) origin[i % 3] = i % 2 == 0 ? -50.0f : 50.0f;
    expect_correct(scene, *tracer, origin, direction, 0.0f, kFar, "axis");
  }
}

// A closed box of axis-aligned faces, each a grid of squares: rays from inside that pass exactly through corners and
// edges and along the grid's planes must all meet it. Flat boxes in the tree, zero components, coincident edges.
TEST(Bvh8, ClosedGridsLeakNowhere) {
  for (const float origin_shift : {0.0f, 1000.25f}) {
    TriangleMesh mesh;
    constexpr int kSide = 8;
    const Vec3f shift(origin_shift);
    for (int axis = 0; axis < 3; ++axis) {
      for (const float side : {-1.0f, 1.0f}) {
        for (int i = 0; i < kSide; ++i) {
          for (int j = 0; j < kSide; ++j) {
            const auto corner = [&](int a, int b) {
              Vec3f p;
              p[axis] = side;
              p[(axis + 1) % 3] = static_cast<float>(2 * a) / kSide - 1.0f;
              p[(axis + 2) % 3] = static_cast<float>(2 * b) / kSide - 1.0f;
              return p + shift;
            };
            add_triangle(mesh, corner(i, j), corner(i + 1, j), corner(i + 1, j + 1));
            add_triangle(mesh, corner(i, j), corner(i + 1, j + 1), corner(i, j + 1));
          }
        }
      }
    }
    Scene scene;
    add_mesh(scene, mesh);
    const auto tracer = make_bvh8_tracer(scene);
    Rng rng(9, RngPurpose::test, 0);
    int leaks = 0;
    for (int i = 0; i < 40000; ++i) {
      const auto on_grid = [&](bool exactly) {
        return exactly ? static_cast<float>(2 * rng.below(kSide - 1) + 2) / kSide - 1.0f : 1.8f * rng.uniform() - 0.9f;
      };
      const Vec3f origin = Vec3f(on_grid(i % 2 == 0), on_grid(i % 3 == 0), on_grid(i % 5 == 0)) + shift;
      const Vec3f target = mesh.positions[rng.below(static_cast<std::uint32_t>(mesh.positions.size()))];
      const Vec3f other = mesh.positions[rng.below(static_cast<std::uint32_t>(mesh.positions.size() / 3)) * 3];
      Vec3f direction = target - origin;                                    // corners
      if (i % 4 == 1) direction = (target * 0.5f + other * 0.5f) - origin;  // edges, diagonals, faces
      if (i % 4 == 2) direction = {};
      if (i % 4 == 2) direction[i % 3] = i % 8 == 2 ? 1.0f : -1.0f;
      if (!(max_component(max(direction, -direction)) > 0.0f)) continue;
      const Hit hit = tracer->intersect(origin, direction, 0.0f, kFar);
      if (!hit.valid() || !tracer->occluded(origin, direction, 0.0f, kFar)) ++leaks;
    }
    EXPECT_EQ(leaks, 0) << "shifted by " << origin_shift;
  }
}

// A round closed mesh without duplicated corners, seen from inside and from far outside through its corners.
TEST(Bvh8, ClosedRoundMeshLeaksNowhere) {
  TriangleMesh mesh;
  constexpr int kRings = 40, kSectors = 60;
  mesh.positions.push_back({0.0f, 0.0f, 1.0f});
  for (int r = 1; r < kRings; ++r) {
    for (int s = 0; s < kSectors; ++s) {
      const float theta = kPi * static_cast<float>(r) / kRings, phi = 2.0f * kPi * static_cast<float>(s) / kSectors;
      mesh.positions.push_back({std::sin(theta) * std::cos(phi), std::sin(theta) * std::sin(phi), std::cos(theta)});
    }
  }
  mesh.positions.push_back({0.0f, 0.0f, -1.0f});
  const auto at = [](int r, int s) { return 1 + (r - 1) * kSectors + s % kSectors; };
  for (int s = 0; s < kSectors; ++s) {
    mesh.triangles.push_back({0, at(1, s), at(1, s + 1)});
    mesh.triangles.push_back({static_cast<int>(mesh.positions.size()) - 1, at(kRings - 1, s + 1), at(kRings - 1, s)});
    for (int r = 1; r < kRings - 1; ++r) {
      mesh.triangles.push_back({at(r, s), at(r + 1, s), at(r + 1, s + 1)});
      mesh.triangles.push_back({at(r, s), at(r + 1, s + 1), at(r, s + 1)});
    }
  }
  Scene scene;
  add_mesh(scene, mesh);
  const auto tracer = make_bvh8_tracer(scene);
  Rng rng(10, RngPurpose::test, 0);
  int leaks = 0;
  for (int i = 0; i < 60000; ++i) {
    const Vec3i t = mesh.triangles[rng.below(static_cast<std::uint32_t>(mesh.triangles.size()))];
    const auto corner = [&](int k) { return mesh.positions[static_cast<std::size_t>(t[k])]; };
    const float share = i % 3 == 0 ? 0.0f : rng.uniform();
    const Vec3f on_edge = corner(0) * (1.0f - share) + corner(1) * share;
    Vec3f origin = random_point(rng, 0.8f);
    if (i % 2 == 0) origin = on_edge * -200.0f + random_point(rng, 0.1f);  // from outside, through the middle
    leaks += tracer->intersect(origin, on_edge - origin, 0.0f, kFar).valid() ? 0 : 1;
  }
  EXPECT_EQ(leaks, 0);
}

TEST(Bvh8, EmptyAndInvalidInput) {
  const Scene empty;
  const auto nothing = make_bvh8_tracer(empty);
  EXPECT_FALSE(nothing->intersect({0, 0, 0}, {0, 0, 1}, 0.0f, kFar).valid());
  EXPECT_FALSE(nothing->occluded({0, 0, 0}, {0, 0, 1}, 0.0f, kFar));
  EXPECT_EQ(build_bvh8(empty).levels, 0);

  constexpr float kNan = std::numeric_limits<float>::quiet_NaN(), kInf = std::numeric_limits<float>::infinity();
  Scene scene = soup(200, 0.8f, 5);
  const Scene clean = scene;
  TriangleMesh& mesh = scene.meshes[0];
  add_triangle(mesh, {kNan, 0, 0}, {1, 0, 0}, {0, 1, 0});
  add_triangle(mesh, {0, 0, 0}, {1, 0, kInf}, {0, 1, 0});
  add_triangle(mesh, {0, 0, 0}, {1, 3e38f, 0}, {0, 1, 0});
  for (int i = 0; i < 20; ++i)
    add_triangle(mesh, {0.1f, 0.1f, 0.1f}, {0.1f, 0.1f, 0.1f}, {0.1f, 0.1f, 0.1f});     // points
  for (int i = 0; i < 20; ++i) add_triangle(mesh, {-1, -1, -1}, {0, 0, 0}, {1, 1, 1});  // lines
  add_sphere(scene, {0, 0, 0}, kNan);
  const Bvh8 bvh = build_bvh8(scene);
  EXPECT_EQ(bvh.left_out, 4u);
  EXPECT_EQ(bvh.primitives.size(), 240u);
  const auto tracer = make_bvh8_tracer(scene), reference = make_bvh8_tracer(clean);
  Rng rng(11, RngPurpose::test, 0);
  int found = 0;
  for (int i = 0; i < 2000; ++i) {
    const Vec3f origin = random_point(rng, 3.0f), direction = uniform_direction(rng.uniform2());
    const Hit a = tracer->intersect(origin, direction, 0.0f, kFar),
              b = reference->intersect(origin, direction, 0.0f, kFar);
    EXPECT_EQ(std::memcmp(&a, &b, sizeof(Hit)), 0);
    found += a.valid() ? 1 : 0;
  }
  EXPECT_GT(found, 300);
  // Rays without meaning meet nothing, and end.
  for (const Vec3f bad : {Vec3f(kNan, 0, 1), Vec3f(0, kInf, 1), Vec3f(0, 0, 0), Vec3f(kNan)}) {
    EXPECT_FALSE(tracer->intersect({0, 0, -5}, bad, 0.0f, kFar).valid());
    EXPECT_FALSE(tracer->occluded({0, 0, -5}, bad, 0.0f, kFar));
  }
  EXPECT_FALSE(tracer->intersect({kNan, 0, 0}, {0, 0, 1}, 0.0f, kFar).valid());
  EXPECT_FALSE(tracer->intersect({0, 0, -5}, {0, 0, 1}, kNan, kFar).valid());
  EXPECT_FALSE(tracer->intersect({0, 0, -5}, {0, 0, 1}, 0.0f, kNan).valid());
  EXPECT_FALSE(tracer->intersect({0, 0, -5}, {0, 0, 1}, 9.0f, 1.0f).valid());
}

// Distances are in lengths of the direction, from where floats of the grids' arithmetic would overflow to where they
// would vanish.
TEST(Bvh8, ShortAndLongDirections) {
  const Scene scene = soup(2000, 0.1f, 23);
  const auto tracer = make_bvh8_tracer(scene);
  Rng rng(24, RngPurpose::test, 0);
  int found = 0;
  for (int i = 0; i < 400; ++i) {
    const Vec3f origin = random_point(rng, 1.5f), direction = uniform_direction(rng.uniform2());
    const Hit unit = tracer->intersect(origin, direction, 0.0f, kFar);
    found += unit.valid() ? 1 : 0;
    for (const int exponent : {-90, -31, -29, 59, 61, 90}) {
      const float scale = std::ldexp(1.0f, exponent);
      const Hit hit = tracer->intersect(origin, direction * scale, 0.0f, kFar);
      EXPECT_EQ(hit.shape, unit.shape) << exponent;
      EXPECT_EQ(hit.primitive, unit.primitive) << exponent;
      EXPECT_FLOAT_EQ(hit.t * scale, unit.t) << exponent;
      EXPECT_EQ(tracer->occluded(origin, direction * scale, 0.0f, kFar), unit.valid());
    }
    EXPECT_FALSE(tracer->intersect(origin - direction * 1e20f, direction, 0.0f, kFar).valid())
        << "farther than floats can tell";
  }
  EXPECT_GT(found, 30);
}

TEST(Bvh8, HugeAndTinyTriangles) {
  Scene scene = soup(300, 0.3f, 12);
  TriangleMesh& mesh = scene.meshes[0];
  add_triangle(mesh, {-1e17f, -1e17f, 4.0f}, {1e17f, -1e17f, 4.0f}, {0.0f, 1e17f, 4.0f});
  for (int i = 0; i < 60; ++i) {  // sizes of 2^-i: what a surface area heuristic peels off one by one
    const float s = std::ldexp(1.0f, -i);
    add_triangle(mesh, {s, s, s}, {1.5f * s, s, s}, {s, 1.5f * s, s});
  }
  const Bvh8 bvh = build_bvh8(scene);
  EXPECT_EQ(bvh.left_out, 0u);
  EXPECT_LE(bvh.levels, kBvh8StackSize);
  const auto tracer = make_bvh8_tracer(scene);
  Rng rng(13, RngPurpose::test, 0);
  for (int i = 0; i < 600; ++i) {
    const float s = std::ldexp(1.0f, -static_cast<int>(rng.below(20)));
    const Vec3f origin = random_point(rng, 3.0f),
                target = i % 2 == 0 ? Vec3f(1.1f * s, 1.1f * s, s) : random_point(rng, 3.0f);
    expect_correct(scene, *tracer, origin, normalize(target - origin), 0.0f, kFar, "huge and tiny");
  }
  EXPECT_TRUE(tracer->intersect({0, 0, 3}, {0, 0, 1}, 0.0f, kFar).valid());
}

// Equal distances: the lowest shape and primitive, whatever the tree.
TEST(Bvh8, CoincidentTriangles) {
  Scene scene;
  TriangleMesh mesh;
  for (int i = 0; i < 5000; ++i) add_triangle(mesh, {0, 0, 0}, {1, 0, 0}, {0, 1, 0});
  add_mesh(scene, mesh);
  add_mesh(scene, mesh);
  const Bvh8 bvh = build_bvh8(scene);
  EXPECT_LE(bvh.levels, 8);
  EXPECT_EQ(bvh.primitives.size(), 10000u);
  const Hit hit = bvh8_intersect(bvh.view(), {0.25f, 0.25f, 1.0f}, {0, 0, -1}, 0.0f, kFar);
  EXPECT_EQ(hit.shape, 0);
  EXPECT_EQ(hit.primitive, 0);
  EXPECT_FLOAT_EQ(hit.t, 1.0f);
  EXPECT_FLOAT_EQ(hit.u, 0.25f);
  EXPECT_FLOAT_EQ(hit.v, 0.25f);
  // Limits: distances in (t_min, t_max].
  EXPECT_TRUE(bvh8_intersect(bvh.view(), {0.25f, 0.25f, 1.0f}, {0, 0, -1}, 0.0f, 1.0f).valid());
  EXPECT_FALSE(bvh8_intersect(bvh.view(), {0.25f, 0.25f, 1.0f}, {0, 0, -1}, 0.0f, 0.9999f).valid());
  EXPECT_FALSE(bvh8_intersect(bvh.view(), {0.25f, 0.25f, 1.0f}, {0, 0, -1}, 1.0f, kFar).valid());
  EXPECT_FALSE(bvh8_intersect(bvh.view(), {0.25f, 0.25f, 0.0f}, {0, 0, -1}, 0.0f, kFar).valid());
}

// Every primitive is in the tree once; every box on the grid contains what is below it; the levels are as stated.
struct Structure {
  const Bvh8& bvh;
  std::vector<int> seen;
  int deepest = 0;
  explicit Structure(const Bvh8& b) : bvh(b), seen(b.primitives.size(), 0) {}

  void visit(std::uint32_t index, int level, const Vec3d& lower, const Vec3d& upper) {
    deepest = std::max(deepest, level + 1);
    const Bvh8Node& node = bvh.nodes.at(index);
    std::uint32_t child = node.child_base, p = node.primitive_base;
    for (unsigned s = 0; s < 8; ++s) {
      Vec3d l, u;
      for (int k = 0; k < 3; ++k) {
        const double scale = bvh8_grid_scale(node.exponents >> (8 * k) & 255u);
        l[k] = static_cast<double>(node.origin[k]) + scale * static_cast<double>(node.bounds[k][0] >> (8 * s) & 0xffu);
        u[k] = static_cast<double>(node.origin[k]) + scale * static_cast<double>(node.bounds[k][1] >> (8 * s) & 0xffu);
      }
      // What is below must be in all boxes above it.
      const Vec3d inner_lower = max(l, lower), inner_upper = min(u, upper);
      if (node.exponents >> (24 + s) & 1u) {
        EXPECT_EQ(node.primitives >> 4 * s & 15u, 0u);
        visit(child++, level + 1, inner_lower, inner_upper);
        continue;
      }
      const unsigned leaf = node.primitives >> 4 * s & 15u;
      EXPECT_EQ(leaf & (leaf + 1), 0u);
      for (int i = 0; i < std::popcount(leaf); ++i, ++p) {
        ++seen.at(p);
        for (int c = 0; c < 9 && !bvh.primitives[p].sphere(); ++c) {
          const double x = static_cast<double>(bvh.primitives[p].rows[c % 3].corner[c / 3]);
          EXPECT_GE(x, inner_lower[c % 3]);
          EXPECT_LE(x, inner_upper[c % 3]);
        }
      }
    }
  }
};

TEST(Bvh8, StructureIsSoundForEveryShapeOfTree) {
  for (const int max_levels : {64, 12, 1}) {
    Scene scene = soup(3000, 0.1f, 21);
    for (int i = 0; i < 40; ++i) {
      const float s = std::ldexp(1.0f, -2 * i);
      add_triangle(scene.meshes[0], {s, s, s}, {1.5f * s, s, s}, {s, 1.5f * s, s});
    }
    add_sphere(scene, {0.1f, 0.2f, 0.3f}, 0.5f);
    const Bvh8 bvh = build_bvh8(scene, {.max_levels = max_levels});
    Structure structure(bvh);
    const double inf = std::numeric_limits<double>::infinity();
    structure.visit(0, 0, Vec3d(-inf), Vec3d(inf));
    EXPECT_EQ(structure.deepest, bvh.levels);
    EXPECT_LE(bvh.levels, std::max(max_levels, 12));
    for (const int n : structure.seen) EXPECT_EQ(n, 1);
    const Bvh8 usual = build_bvh8(scene);
    Rng rng(22, RngPurpose::test, 0);
    for (int i = 0; i < 3000; ++i) {
      const Vec3f origin = random_point(rng, 3.0f), direction = uniform_direction(rng.uniform2());
      const Hit a = bvh8_intersect(bvh.view(), origin, direction, 0.0f, kFar),
                b = bvh8_intersect(usual.view(), origin, direction, 0.0f, kFar);
      EXPECT_EQ(std::memcmp(&a, &b, sizeof(Hit)), 0) << "the hit depends on the tree";
    }
  }
}

TEST(Bvh8, SameBytesAtAnyThreadCount) {
  Scene scene = soup(150000, 0.02f, 31);
  add_sphere(scene, {0, 0, 0}, 0.1f);
  set_thread_count(1);
  const Bvh8 one = build_bvh8(scene);
  for (const int threads : {2, 4}) {
    set_thread_count(threads);
    const Bvh8 many = build_bvh8(scene);
    ASSERT_EQ(one.nodes.size(), many.nodes.size());
    EXPECT_EQ(std::memcmp(one.nodes.data(), many.nodes.data(), one.nodes.size() * sizeof(Bvh8Node)), 0);
    EXPECT_EQ(std::memcmp(one.primitives.data(), many.primitives.data(), one.primitives.size() * sizeof(Bvh8Primitive)),
              0);
  }
  set_thread_count(0);
}

// ---- The shared scenes against Embree ------------------------------------------------------------------------------

// How far a ray may pass from a triangle's edge, or its distance differ, by rounding in float: a few units of rounding
// of the numbers that go in, over the sine between ray and surface. In world units.
struct Doubt {
  double distance, edge;
};

Doubt doubt(const Scene& scene, const Hit& hit, Vec3f origin, Vec3f direction) {
  const Shape& shape = scene.shapes[static_cast<std::size_t>(hit.shape)];
  if (shape.kind == Shape::Kind::sphere) return {0.0, 0.0};
  const TriangleMesh& m = scene.meshes[static_cast<std::size_t>(shape.geometry)];
  const Vec3i t = m.triangles[static_cast<std::size_t>(hit.primitive)];
  const auto at = [&](int k) { return Vec3d(m.positions[static_cast<std::size_t>(t[k])]); };
  const Vec3d o(origin), d(direction), n = cross(at(1) - at(0), at(2) - at(0));
  const double size = std::max({length(at(0) - o), length(at(1) - o), length(at(2) - o)});
  const double sine = std::fabs(dot(n, d)) / (length(n) * length(d)), rounding = 16.0 * size * 0x1p-24;
  // Distance of the line from the nearest edge; negative inside is not needed: what matters is how near.
  double edge = std::numeric_limits<double>::infinity();
  for (int k = 0; k < 3; ++k) {
    const Vec3d p = at(k), e = at((k + 1) % 3) - p, across = cross(e, d);
    const double l = length(across);
    if (l > 0.0) edge = std::min(edge, std::fabs(dot(o - p, across)) / l);
  }
  return {rounding / std::max(sine, 1e-12), edge / rounding};
}

Exact exact_of(const Scene& scene, const Hit& hit, Vec3f origin, Vec3f direction) {
  if (!hit.valid() || scene.shapes[static_cast<std::size_t>(hit.shape)].kind == Shape::Kind::sphere) return {};
  const auto mesh = static_cast<std::size_t>(scene.shapes[static_cast<std::size_t>(hit.shape)].geometry);
  return exact_triangle(scene.meshes[mesh], static_cast<std::size_t>(hit.primitive), origin, direction);
}

class Bvh8SharedScenes : public ::testing::TestWithParam<const char*> {};

TEST_P(Bvh8SharedScenes, AgreesWithEmbree) {
  const std::filesystem::path file = shared_folder() / "scenes" / GetParam() / "scene.xml";
  if (!std::filesystem::exists(file)) GTEST_SKIP() << "no shared scene at " << file;
  const Scene scene = load_scene(file.string());
  const auto ours = make_bvh8_tracer(scene), embree = make_embree_tracer(scene);
  const SurfaceSampler sampler(scene);
  const char* given = std::getenv("OCTRAD_TEST_RAYS");
  const int rays = given != nullptr ? std::atoi(given) : 60000;
  struct Count {
    int same = 0, tie = 0, doubtful = 0, doubtful_corners = 0, wrong = 0, occlusion = 0;
  };
  std::vector<Count> counts(64);
  parallel_for(counts.size(), [&](std::size_t block) {
    Count& count = counts[block];
    for (int i = static_cast<int>(block); i < rays; i += static_cast<int>(counts.size())) {
      Rng rng(41, RngPurpose::test, static_cast<std::uint64_t>(i));
      const SurfaceInteraction s = sampler.sample(rng.uniform(), rng.uniform2());
      Vec3f direction = uniform_direction(rng.uniform2()),
            origin = offset_origin(s.position, s.geometric_normal, direction);
      float t_min = 0.0f;
      switch (i % 8) {
        case 0: {  // grazing: along the surface
          const Vec3f n = s.geometric_normal;
          direction = normalize(direction - n * (dot(n, direction) * (1.0f - 0.01f * rng.uniform())));
          break;
        }
        case 1: {  // along an axis
          const int axis = static_cast<int>(rng.below(3));
          const float sign = rng.below(2) == 0 ? 1.0f : -1.0f;
          direction = Vec3f(rng.below(2) == 0 ? 0.0f : -0.0f);
          direction[axis] = sign;
          origin = offset_origin(s.position, s.geometric_normal, direction);
          break;
        }
        case 2: {  // from one surface to a corner of another
          const Shape& shape = scene.shapes[rng.below(static_cast<std::uint32_t>(scene.shapes.size()))];
          if (shape.kind == Shape::Kind::mesh) {
            const auto& positions = scene.meshes[static_cast<std::size_t>(shape.geometry)].positions;
            const Vec3f to = positions[rng.below(static_cast<std::uint32_t>(positions.size()))] - origin;
            if (length(to) > 0.0f) direction = normalize(to);
          }
          break;
        }
        case 3:  // from the surface itself, beginning further on
          origin = s.position;
          t_min = 1e-3f * length(scene.bounds.extent());
          break;
        case 4: {  // from outside
          origin = s.position - direction * (2.0f * length(scene.bounds.extent()));
          break;
        }
        default: break;
      }
      const float t_max = i % 16 < 12 ? kFar : length(scene.bounds.extent()) * rng.uniform();
      const Hit a = ours->intersect(origin, direction, t_min, t_max),
                b = embree->intersect(origin, direction, t_min, t_max);
      if (ours->occluded(origin, direction, t_min, t_max) != a.valid()) ++count.occlusion;
      if (a.shape == b.shape && a.primitive == b.primitive && (!a.valid() || std::fabs(a.t - b.t) <= 1e-4f * b.t)) {
        ++count.same;
        continue;
      }
      if (a.valid() && b.valid() && std::fabs(a.t - b.t) <= 1e-4f * std::max(a.t, b.t)) {
        ++count.tie;
        continue;
      }
      // One of them rejected what the other met, or stopped at another distance: the nearer one must be a matter of
      // rounding.
      const Hit& nearer = !b.valid() || (a.valid() && a.t < b.t) ? a : b;
      const Doubt d = doubt(scene, nearer, origin, direction);
      const double limit = d.distance * static_cast<double>(length(direction));
      const bool at_limit = std::fabs(static_cast<double>(nearer.t - t_min)) < limit ||
                            std::fabs(static_cast<double>(nearer.t - t_max)) < limit;
      if (d.edge < 1.0 || at_limit || (a.valid() && b.valid() && std::fabs(static_cast<double>(a.t - b.t)) < limit)) {
        ++(i % 8 == 2 ? count.doubtful_corners : count.doubtful);
      } else if (++count.wrong <= 3) {
        ADD_FAILURE() << "ray " << i << " ours " << a.shape << ":" << a.primitive << " t " << a.t << ", Embree "
                      << b.shape << ":" << b.primitive << " t " << b.t << ", edge " << d.edge << ", t_max " << t_max
                      << ", doubt " << d.distance << "; exact " << exact_of(scene, a, origin, direction).t << ", "
                      << exact_of(scene, b, origin, direction).t;
      }
    }
  });
  Count sum;
  for (const Count& c : counts) {
    sum.same += c.same;
    sum.tie += c.tie;
    sum.doubtful += c.doubtful;
    sum.doubtful_corners += c.doubtful_corners;
    sum.wrong += c.wrong;
    sum.occlusion += c.occlusion;
  }
  std::printf(
      "%s: %d rays, %d same, %d ties, %d within rounding of an edge or an end, %d the same of those aimed at corners, %d wrong\n",
      GetParam(), rays, sum.same, sum.tie, sum.doubtful, sum.doubtful_corners, sum.wrong);
  EXPECT_EQ(sum.wrong, 0);
  EXPECT_EQ(sum.occlusion, 0);
  EXPECT_LT(sum.doubtful, rays / 1000);
  EXPECT_LT(sum.doubtful_corners, rays / 50);  // of an eighth of the rays
  EXPECT_GT(sum.same, rays / 2);
}

INSTANTIATE_TEST_SUITE_P(All, Bvh8SharedScenes,
                         ::testing::Values("bathroom", "cbox-mitsuba", "cornell-box", "kitchen", "living-room",
                                           "veach-ajar"),
                         [](const auto& scene) {
                           std::string name = scene.param;
                           for (char& c : name) c = c == '-' ? '_' : c;
                           return name;
                         });

}  // namespace
}  // namespace octrad
