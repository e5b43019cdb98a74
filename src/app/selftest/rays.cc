#include "app/selftest/rays.h"

#include <algorithm>
#include <limits>

#include "app/selftest/entries.h"
#include "octrad/base/rng.h"
#include "octrad/base/threads.h"
#include "octrad/geometry/offset_math.h"
#include "octrad/geometry/surface_sampling.h"

namespace octrad::selftest {
namespace {

void add_shape(Scene& scene, Shape::Kind kind, std::size_t geometry) {
  Shape shape;
  shape.kind = kind;
  shape.geometry = static_cast<int>(geometry);
  scene.shapes.push_back(shape);
}

void add_corners(TriangleMesh& mesh, Vec3f a, Vec3f b, Vec3f c) {
  const int first = static_cast<int>(mesh.positions.size());
  mesh.positions.insert(mesh.positions.end(), {a, b, c});
  mesh.triangles.push_back({first, first + 1, first + 2});
}

Vec3f random_point(Rng& rng, float size) {
  return {size * (rng.uniform() - 0.5f), size * (rng.uniform() - 0.5f), size * (rng.uniform() - 0.5f)};
}

}  // namespace

Scene built_in_scene(std::uint64_t seed) {
  constexpr int kTriangles = 20'000, kSpheres = 50;
  Scene scene;
  scene.file = "(built in)";
  Rng rng(seed, RngPurpose::test, 0);
  TriangleMesh room, soup;
  for (int axis = 0; axis < 3; ++axis) {
    for (const float side : {-1.0f, 1.0f}) {
      const auto corner = [&](float u, float v) {
        Vec3f p;
        p[axis] = side;
        p[(axis + 1) % 3] = u;
        p[(axis + 2) % 3] = v;
        return p;
      };
      add_corners(room, corner(-1, -1), corner(1, -1), corner(1, 1));
      add_corners(room, corner(-1, -1), corner(1, 1), corner(-1, 1));
    }
  }
  for (int i = 0; i < kTriangles; ++i) {
    const Vec3f p = random_point(rng, 1.8f);
    const float size = 0.2f * rng.uniform() * rng.uniform();
    add_corners(soup, p, p + random_point(rng, size), p + random_point(rng, size));
  }
  for (TriangleMesh* mesh : {&room, &soup}) {
    add_shape(scene, Shape::Kind::mesh, scene.meshes.size());
    scene.meshes.push_back(std::move(*mesh));
  }
  for (int i = 0; i < kSpheres; ++i) {
    Sphere sphere;
    sphere.center = random_point(rng, 1.6f);
    sphere.radius = 0.01f + 0.1f * rng.uniform();
    add_shape(scene, Shape::Kind::sphere, scene.spheres.size());
    scene.spheres.push_back(sphere);
  }
  scene.bounds.lower = {-1, -1, -1};
  scene.bounds.upper = {1, 1, 1};
  return scene;
}

std::vector<RayQuery> incoherent_rays(const Scene& scene, std::size_t n, std::uint64_t seed) {
  const SurfaceSampler sampler(scene);
  std::vector<RayQuery> rays(n);
  for (std::size_t i = 0; i < n; ++i) {
    Rng rng(seed, RngPurpose::test, i);
    const float pick = rng.uniform();
    const SurfaceInteraction s = sampler.sample(pick, rng.uniform2());
    const Vec3f d = uniform_direction(rng.uniform2());
    rays[i] = {offset_origin(s.position, s.geometric_normal, d), d, 1e30f};
  }
  return rays;
}

RayFixture::RayFixture(const Context& context, std::size_t n, bool finite)
    : host_(incoherent_rays(context.scene, n, context.seed)),
      rays_(context.stream, n, "rays"),
      nodes_(context.stream, std::span<const Bvh8Node>(context.bvh.nodes), "the ray tracing tree"),
      primitives_(context.stream, std::span<const Bvh8Primitive>(context.bvh.primitives), "the ray tracing tree") {
  const float size = length(context.scene.bounds.upper - context.scene.bounds.lower);
  std::vector<DeviceRay> rays(n);
  for (std::size_t i = 0; i < n; ++i) {
    if (finite) host_[i].t_max = size * 0.5f * Rng(context.seed + 1, RngPurpose::test, i).uniform();
    rays[i] = {host_[i].origin, host_[i].t_max, host_[i].direction, 0.0f};
  }
  rays_.upload(rays);
}

Bvh8View RayFixture::bvh() const {
  return {nodes_.data(), primitives_.data(), static_cast<std::uint32_t>(nodes_.size()),
          static_cast<std::uint32_t>(primitives_.size())};
}

namespace {

// Our tree on the stream against another answer for each ray: that of Embree, or of the same tree on the CPU.
CheckResult compare_hits(const Context& c, decltype(run_closest)* run, bool embree, double tolerance, double allowed) {
  const RayFixture rays(c, c.items(1 << 20, 1 << 15));
  const DeviceArray<Hit> hits(c.stream, rays.size(), "selftest");
  run(c.stream, rays.size(), rays.bvh(), rays.data(), hits.data());
  const std::vector<Hit> got = hits.download();
  std::vector<Hit> expected(rays.size());
  parallel_for(rays.size(), [&](std::size_t i) {
    const RayQuery& r = rays.host()[i];
    expected[i] = embree ? c.tracer.intersect(r.origin, r.direction, 0.0f, r.t_max)
                         : bvh8_intersect(c.bvh.view(), r.origin, r.direction, 0.0f, r.t_max);
  });
  Errors errors;
  for (std::size_t i = 0; i < got.size(); ++i) {
    if (got[i].valid() != expected[i].valid()) errors.add(std::numeric_limits<double>::infinity());
    else
      errors.add(got[i].valid() ? std::fabs(static_cast<double>(got[i].t) - expected[i].t) /
                                      std::max(1e-20, static_cast<double>(expected[i].t))
                                : 0.0);
  }
  return errors.result("relative error of t", tolerance, allowed);
}

CheckResult compare_occlusion(const Context& c, decltype(run_occluded)* run, bool embree, double allowed) {
  const RayFixture rays(c, c.items(1 << 20, 1 << 15), true);
  const DeviceArray<std::uint32_t> blocked(c.stream, rays.size(), "selftest");
  run(c.stream, rays.size(), rays.bvh(), rays.data(), blocked.data());
  const std::vector<std::uint32_t> got = blocked.download();
  Errors errors;
  for (std::size_t i = 0; i < got.size(); ++i) {
    const RayQuery& r = rays.host()[i];
    const bool expected = embree ? c.tracer.occluded(r.origin, r.direction, 0.0f, r.t_max)
                                 : bvh8_occluded(c.bvh.view(), r.origin, r.direction, 0.0f, r.t_max);
    errors.add((got[i] != 0) == expected ? 0.0 : 1.0);
  }
  return errors.result(embree ? "other answers than Embree" : "other answers than the CPU", 0.0, allowed);
}

}  // namespace

CheckResult check_closest_embree(const Context& c) { return compare_hits(c, run_closest, true, 1e-4, 1e-4); }
CheckResult check_closest_cpu(const Context& c) { return compare_hits(c, run_closest, false, 1e-6, 1e-5); }
CheckResult check_closest_alone(const Context& c) { return compare_hits(c, run_closest_alone, false, 1e-6, 1e-5); }
// Edges, and lengths that end on a surface, may be decided differently.
CheckResult check_occluded(const Context& c) { return compare_occlusion(c, run_occluded, true, 1e-4); }
CheckResult check_occluded_alone(const Context& c) { return compare_occlusion(c, run_occluded_alone, false, 1e-5); }

}  // namespace octrad::selftest
