#include "octrad/geometry/tracer.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "octrad/base/rng.h"

namespace octrad {
namespace {

// A bumpy grid of triangles and some spheres around it.
Scene bumpy_scene() {
  Scene scene;
  TriangleMesh m;
  constexpr int kSide = 24;
  Rng rng(1, RngPurpose::test, 0);
  for (int y = 0; y <= kSide; ++y) {
    for (int x = 0; x <= kSide; ++x)
      m.positions.push_back(
          {static_cast<float>(x) * 0.2f - 2.4f, 0.3f * rng.uniform(), static_cast<float>(y) * 0.2f - 2.4f});
  }
  for (int y = 0; y < kSide; ++y) {
    for (int x = 0; x < kSide; ++x) {
      const int i = y * (kSide + 1) + x;
      m.triangles.push_back({i, i + kSide + 1, i + 1});
      m.triangles.push_back({i + 1, i + kSide + 1, i + kSide + 2});
    }
  }
  scene.meshes.push_back(m);
  Shape mesh;
  mesh.geometry = 0;
  scene.shapes.push_back(mesh);
  for (int i = 0; i < 5; ++i) {
    Sphere s;
    s.center = {2.0f * rng.uniform() - 1.0f, 0.8f + rng.uniform(), 2.0f * rng.uniform() - 1.0f};
    s.radius = 0.1f + 0.3f * rng.uniform();
    scene.spheres.push_back(s);
    Shape shape;
    shape.kind = Shape::Kind::sphere;
    shape.geometry = i;
    scene.shapes.push_back(shape);
  }
  return scene;
}

// Moeller & Trumbore 1997 and the quadratic, in double.
double brute_force(const Scene& scene, Vec3f origin, Vec3f direction) {
  double nearest = std::numeric_limits<double>::infinity();
  const Vec3d o(origin), d(direction);
  const TriangleMesh& m = scene.meshes[0];
  for (const Vec3i& t : m.triangles) {
    const Vec3d p0(m.positions[static_cast<std::size_t>(t.x)]);
    const Vec3d e1 = Vec3d(m.positions[static_cast<std::size_t>(t.y)]) - p0,
                e2 = Vec3d(m.positions[static_cast<std::size_t>(t.z)]) - p0;
    const Vec3d p = cross(d, e2), s = o - p0, q = cross(s, e1);
    const double det = dot(e1, p);
    if (det == 0.0) continue;
    const double u = dot(s, p) / det, v = dot(d, q) / det, distance = dot(e2, q) / det;
    if (u >= 0.0 && v >= 0.0 && u + v <= 1.0 && distance >= 0.0 && distance < nearest) nearest = distance;
  }
  for (const Sphere& s : scene.spheres) {
    const Vec3d c = o - Vec3d(s.center);
    const double b = dot(c, d), h = b * b - dot(c, c) + static_cast<double>(s.radius) * static_cast<double>(s.radius);
    if (h < 0.0) continue;
    for (const double distance : {-b - std::sqrt(h), -b + std::sqrt(h)}) {
      if (distance >= 0.0 && distance < nearest) nearest = distance;
    }
  }
  return nearest;
}

TEST(Tracer, AgreesWithBruteForceOnEveryInstructionSet) {
  const Scene scene = bumpy_scene();
  for (const char* config : {"", "isa=avx2", "isa=sse2"}) {
    const auto tracer = make_embree_tracer(scene, config);
    Rng rng(2, RngPurpose::test, 0);
    std::vector<RayQuery> rays;
    for (int i = 0; i < 1003; ++i) {
      const Vec3f origin{4.0f * rng.uniform() - 2.0f, 0.6f + 1.5f * rng.uniform(), 4.0f * rng.uniform() - 2.0f};
      rays.push_back({origin, normalize(uniform_direction(rng.uniform2())), i % 3 == 0 ? 0.7f : 1e30f});
    }
    std::vector<Hit> hits(rays.size());
    std::vector<unsigned char> blocked(rays.size());
    tracer->intersect(rays, hits.data());
    tracer->occluded(rays, blocked.data());
    int found = 0;
    for (std::size_t i = 0; i < rays.size(); ++i) {
      const RayQuery& r = rays[i];
      const double t = brute_force(scene, r.origin, r.direction);
      if (std::fabs(t - static_cast<double>(r.t_max)) < 1e-3) continue;
      const bool expected = t <= static_cast<double>(r.t_max);
      const Hit single = tracer->intersect(r.origin, r.direction, 0.0f, r.t_max);
      EXPECT_EQ(hits[i].valid(), expected) << config << i;
      EXPECT_EQ(single.valid(), expected) << config << i;
      EXPECT_EQ(blocked[i] != 0, expected) << config << i;
      EXPECT_EQ(tracer->occluded(r.origin, r.direction, 0.0f, r.t_max), expected) << config << i;
      if (!expected || !hits[i].valid()) continue;
      ++found;
      EXPECT_NEAR(hits[i].t, t, 1e-4 * (1.0 + t)) << config << i;
      EXPECT_NEAR(single.t, t, 1e-4 * (1.0 + t)) << config << i;
      EXPECT_EQ(hits[i].shape, single.shape);
      const SurfaceInteraction s = interact(scene, hits[i], r.origin, r.direction);
      EXPECT_NEAR(length(s.position - (r.origin + r.direction * static_cast<float>(t))), 0.0f, 1e-3f);
    }
    EXPECT_GT(found, 200);
  }
}

TEST(Tracer, ShiftedOriginsDoNotMeetTheirSurface) {
  const Scene scene = bumpy_scene();
  const auto tracer = make_embree_tracer(scene);
  Rng rng(3, RngPurpose::test, 0);
  int leaving = 0, self_hits = 0;
  for (int i = 0; i < 4000; ++i) {
    const Vec3f origin{2.0f * rng.uniform() - 1.0f, 0.6f + rng.uniform(), 2.0f * rng.uniform() - 1.0f},
        direction = uniform_direction(rng.uniform2());
    const Hit hit = tracer->intersect(origin, direction, 0.0f, 1e30f);
    if (!hit.valid()) continue;
    const SurfaceInteraction s = interact(scene, hit, origin, direction);
    const Vec3f out = uniform_direction(rng.uniform2());
    const Hit again = tracer->intersect(offset_origin(s.position, s.geometric_normal, out), out, 0.0f, 1e30f);
    ++leaving;
    const bool convex_side = scene.shapes[static_cast<std::size_t>(hit.shape)].kind != Shape::Kind::sphere ||
                             dot(out, s.geometric_normal) > 0.0f;
    if (convex_side && again.valid() && again.shape == hit.shape && again.primitive == hit.primitive) ++self_hits;
  }
  EXPECT_GT(leaving, 1000);
  EXPECT_EQ(self_hits, 0);
}

TEST(Tracer, EmptySceneIsEmpty) {
  const Scene scene;
  const auto tracer = make_embree_tracer(scene);
  EXPECT_FALSE(tracer->intersect({0, 0, 0}, {0, 0, 1}, 0.0f, 1e30f).valid());
  EXPECT_FALSE(tracer->occluded({0, 0, 0}, {0, 0, 1}, 0.0f, 1e30f));
}

}  // namespace
}  // namespace octrad
