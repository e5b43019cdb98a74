// Occupancy against brute force, Morton order, parents, spheres; area-uniform sampling.
#include "octrad/geometry/voxelize.h"

#include <gtest/gtest.h>

#include <set>

#include "octrad/base/error.h"
#include "octrad/base/morton.h"
#include "octrad/base/rng.h"
#include "octrad/base/threads.h"
#include "octrad/geometry/surface_sampling.h"

namespace octrad {
namespace {

// Independent oracle: clips the triangle by the six planes of the box (Sutherland & Hodgman 1974); something is left or
// not.
bool clip_overlaps(Vec3d lower, Vec3d upper, Vec3d a, Vec3d b, Vec3d c) {
  std::vector<Vec3d> polygon = {a, b, c};
  for (int axis = 0; axis < 3; ++axis) {
    for (const double sign : {1.0, -1.0}) {
      const double plane = sign > 0 ? lower[axis] : -upper[axis];
      std::vector<Vec3d> kept;
      for (std::size_t i = 0; i < polygon.size(); ++i) {
        const Vec3d p = polygon[i], q = polygon[(i + 1) % polygon.size()];
        const double dp = sign * p[axis] - plane, dq = sign * q[axis] - plane;
        if (dp >= 0) kept.push_back(p);
        if ((dp >= 0) != (dq >= 0)) kept.push_back(p + (q - p) * (dp / (dp - dq)));
      }
      polygon = kept;
      if (polygon.empty()) return false;
    }
  }
  return true;
}

Scene triangle_soup(int n, float size) {
  Scene scene;
  TriangleMesh mesh;
  for (int i = 0; i < n; ++i) {
    Rng rng(1, RngPurpose::test, static_cast<unsigned long long>(i));
    const auto point = [&] { return Vec3f(rng.uniform(), rng.uniform(), rng.uniform()); };
    const Vec3f center = point();
    for (int k = 0; k < 3; ++k) {
      mesh.positions.push_back(center + (point() - Vec3f(0.5f)) * size);
      scene.bounds.extend(mesh.positions.back());
    }
    mesh.triangles.push_back({3 * i, 3 * i + 1, 3 * i + 2});
  }
  scene.meshes.push_back(mesh);
  scene.shapes.push_back({Shape::Kind::mesh, 0, 0, -1, "soup"});
  return scene;
}

TEST(Voxelize, AgreesWithClippingEveryCell) {
  for (const float size : {0.02f, 0.3f, 2.0f}) {
    const Scene scene = triangle_soup(40, size);
    const Domain domain = scene_domain(scene.bounds, false);
    const int levels = 3, resolution = 16;
    const auto cells = occupied_cells(scene, domain, levels);
    std::set<std::uint64_t> found;
    for (const Vec3i& c : cells[2]) found.insert(morton_code(c));
    int borderline = 0;
    for (std::uint64_t code = 0; code < 16 * 16 * 16; ++code) {
      const Vec3i c = morton_cell(code);
      bool inner = false, outer = false;
      for (const Vec3i& t : scene.meshes[0].triangles) {
        Vec3d p[3];
        for (int k = 0; k < 3; ++k) {
          p[k] = (Vec3d(scene.meshes[0].positions[static_cast<std::size_t>(t[k])]) - Vec3d(domain.origin)) /
                 Vec3d(domain.size) * static_cast<double>(resolution);
        }
        inner = inner || clip_overlaps(Vec3d(c), Vec3d(c) + Vec3d(1.0), p[0], p[1], p[2]);
        outer = outer || clip_overlaps(Vec3d(c) - Vec3d(2e-4), Vec3d(c) + Vec3d(1.0002), p[0], p[1], p[2]);
      }
      if (inner) {
        EXPECT_TRUE(found.count(code)) << "a hole at cell " << code << ", size " << size;
      }
      if (!outer) {
        EXPECT_FALSE(found.count(code)) << "a spurious cell " << code << ", size " << size;
      }
      borderline += outer != inner;
    }
    EXPECT_LT(borderline, 40);
  }
}

// Positions outside the domain are looked up at its nearest place: its cells there must be there.
TEST(Voxelize, SurfacesOutsideOccupyTheRim) {
  Scene scene = triangle_soup(60, 1.5f);
  scene.spheres.push_back({{0.2f, 0.9f, 0.5f}, 0.35f});
  scene.shapes.push_back({Shape::Kind::sphere, 0, 0, -1, "sphere"});
  const Domain domain{{0.3f, 0.35f, 0.25f}, {0.4f, 0.3f, 0.5f}};
  const int resolution = 16;
  std::set<std::uint64_t> found, reached;
  const auto cells = occupied_cells(scene, domain, 3).back();
  for (const Vec3i& c : cells) found.insert(morton_code(c));
  const SurfaceSampler surfaces(scene);
  for (int i = 0; i < 200000; ++i) {
    Rng rng(2, RngPurpose::test, static_cast<unsigned long long>(i));
    const float pick = rng.uniform();
    const Vec3f p = (surfaces.sample_position(pick, rng.uniform2()) - domain.origin) / domain.size;
    Vec3i c;
    for (int a = 0; a < 3; ++a) c[a] = std::clamp(static_cast<int>(std::floor(p[a] * resolution)), 0, resolution - 1);
    reached.insert(morton_code(c));
    EXPECT_TRUE(found.count(morton_code(c))) << c.x << ' ' << c.y << ' ' << c.z;
  }
  EXPECT_GT(reached.size(), found.size() * 8 / 10);
  EXPECT_LT(found.size(), 16u * 16 * 16);
}

TEST(Voxelize, LevelsAreParentsInMortonOrder) {
  const auto cells = occupied_cells(triangle_soup(200, 0.1f), {{0, 0, 0}, {1, 1, 1}}, 5);
  for (std::size_t l = 0; l < cells.size(); ++l) {
    for (std::size_t i = 1; i < cells[l].size(); ++i) EXPECT_LT(morton_code(cells[l][i - 1]), morton_code(cells[l][i]));
    if (l == 0) continue;
    std::set<std::uint64_t> parents, above;
    for (const Vec3i& c : cells[l]) parents.insert(morton_code(c) >> 3);
    for (const Vec3i& c : cells[l - 1]) above.insert(morton_code(c));
    EXPECT_EQ(parents, above);
  }
}

TEST(Voxelize, SphereShellHoldsItsSurfaceOnly) {
  Scene scene;
  scene.spheres.push_back({{0.5f, 0.5f, 0.5f}, 0.4f});
  scene.shapes.push_back({Shape::Kind::sphere, 0, 0, -1, "sphere"});
  const Domain domain{{0, 0, 0}, {1, 1, 1}};
  const auto cells = occupied_cells(scene, domain, 4).back();
  std::set<std::uint64_t> found;
  for (const Vec3i& c : cells) found.insert(morton_code(c));
  const SurfaceSampler surfaces(scene);
  for (int i = 0; i < 20000; ++i) {
    Rng rng(2, RngPurpose::test, static_cast<unsigned long long>(i));
    const Vec3f p = surfaces.sample(rng.uniform(), rng.uniform2()).position * 32.0f;
    EXPECT_TRUE(found.count(morton_code({static_cast<int>(p.x), static_cast<int>(p.y), static_cast<int>(p.z)})));
  }
  for (const Vec3i& c : cells) {
    const double distance = length((Vec3d(c) + Vec3d(0.5)) / 32.0 - Vec3d(0.5));
    EXPECT_LT(std::abs(distance - 0.4), 0.5 * std::sqrt(3.0) / 32.0 + 1e-3);
  }
}

TEST(Voxelize, SampledCellsAreAmongTheConservativeOnesAndApproachThem) {
  const Scene scene = triangle_soup(50, 0.5f);
  const Domain domain = scene_domain(scene.bounds, true);
  const auto exact = occupied_cells(scene, domain, 4).back(),
             sampled = sampled_cells(scene, domain, 4, 1, 1 << 18).back();
  std::set<std::uint64_t> all;
  for (const Vec3i& c : exact) all.insert(morton_code(c));
  for (const Vec3i& c : sampled) EXPECT_TRUE(all.count(morton_code(c)));
  EXPECT_GT(sampled.size(), exact.size() * 8 / 10);
}

TEST(Voxelize, SameCellsAtAnyThreadCount) {
  const Scene scene = triangle_soup(500, 0.2f);
  set_thread_count(1);
  const auto one = occupied_cells(scene, scene_domain(scene.bounds, true), 5);
  set_thread_count(3);
  const auto three = occupied_cells(scene, scene_domain(scene.bounds, true), 5);
  set_thread_count(0);
  EXPECT_TRUE(one == three);
}

// How many tests are allowed decides, not what was marked before: the same answer at any thread count.
TEST(Voxelize, WorkIsBounded) {
  Scene scene;
  TriangleMesh mesh;
  mesh.positions = {{0, 0, 0.02f}, {1, 0, 0.4f}, {0, 1, 0.9f}};
  mesh.triangles = {{0, 1, 2}};
  scene.meshes.push_back(mesh);
  Shape shape;
  shape.geometry = 0;
  const Domain unit{{0, 0, 0}, {1, 1, 1}};
  const auto refused = [&](std::size_t copies, int levels, std::uint64_t most) {
    scene.shapes.assign(copies, shape);
    int refusals = 0;
    for (int i = 0; i < 2; ++i) {
      try {
        occupied_cells(scene, unit, levels, most);
      } catch (const InputError&) {
        ++refusals;
      }
    }
    EXPECT_TRUE(refusals == 0 || refusals == 2);
    return refusals > 0;
  };
  // One triangle, by any number of instances: the time grows with them. 32 cells an axis.
  std::uint64_t of_one = 100;
  EXPECT_TRUE(refused(100, 4, 100 * of_one));
  while (of_one < 10'000 && refused(100, 4, 100 * of_one)) of_one *= 2;
  EXPECT_LT(of_one, 10'000u);
  EXPECT_FALSE(refused(90, 4, 100 * of_one));
  EXPECT_TRUE(refused(250, 4, 100 * of_one));
  EXPECT_TRUE(refused(100, 6, 100 * of_one));
  // What lies in one cell counts too.
  scene.meshes[0].positions = {{0.51f, 0.51f, 0.51f}, {0.52f, 0.51f, 0.51f}, {0.51f, 0.52f, 0.51f}};
  EXPECT_FALSE(refused(1000, 2, 1000));
  EXPECT_TRUE(refused(1300, 2, 1000));
  // The triangles of a mesh that is there once do not.
  scene.meshes[0].triangles.assign(2000, {0, 1, 2});
  EXPECT_FALSE(refused(1, 2, 0));
}

TEST(Voxelize, RefusesNonsense) {
  const Scene scene = triangle_soup(1, 0.1f);
  EXPECT_THROW(occupied_cells(scene, {{0, 0, 0}, {1, 1, 1}}, 10), UsageError);
  EXPECT_THROW(occupied_cells(scene, {{0, 0, 0}, {1, 0, 1}}, 3), InputError);
  EXPECT_THROW(SurfaceSampler(Scene{}), InputError);
}

TEST(SurfaceSampling, PositionAloneIsTheSamePoint) {
  Scene scene = triangle_soup(40, 1.0f);
  scene.spheres.push_back({{0.5f, 0.5f, 0.5f}, 0.4f});
  scene.shapes.push_back({Shape::Kind::sphere, 0, 0, -1, "sphere"});
  const SurfaceSampler surfaces(scene);
  int on_sphere = 0;
  for (int i = 0; i < 2000; ++i) {
    Rng rng(4, RngPurpose::test, static_cast<unsigned long long>(i));
    const float pick = i == 0 ? 0.0f : i == 1 ? std::nextafter(1.0f, 0.0f) : rng.uniform();
    const Vec2f u = rng.uniform2();
    const SurfaceInteraction si = surfaces.sample(pick, u);
    EXPECT_LT(length(si.position - surfaces.sample_position(pick, u)), 1e-6f);
    on_sphere += si.shape == 1;
  }
  EXPECT_GT(on_sphere, 0);
  EXPECT_EQ(surfaces.sample(0.0f, {0, 0}).shape, 0);
  EXPECT_EQ(surfaces.sample(std::nextafter(1.0f, 0.0f), {0, 0}).shape, 1);
}

TEST(SurfaceSampling, CountsFollowArea) {
  Scene scene = triangle_soup(3, 1.0f);
  const SurfaceSampler surfaces(scene);
  const int n = 60000;
  double areas[3], counts[3] = {};
  for (int t = 0; t < 3; ++t) {
    const auto& p = scene.meshes[0].positions;
    const auto i = static_cast<std::size_t>(3 * t);
    areas[t] = static_cast<double>(0.5f * length(cross(p[i + 1] - p[i], p[i + 2] - p[i])));
  }
  for (int i = 0; i < n; ++i) {
    Rng rng(3, RngPurpose::test, static_cast<unsigned long long>(i));
    const float pick = rng.uniform();
    const SurfaceInteraction si = surfaces.sample(pick, rng.uniform2());
    for (int t = 0; t < 3; ++t) {
      const Vec3f p0 = scene.meshes[0].positions[static_cast<std::size_t>(3 * t)];
      const Vec3f n0 = normalize(cross(scene.meshes[0].positions[static_cast<std::size_t>(3 * t + 1)] - p0,
                                       scene.meshes[0].positions[static_cast<std::size_t>(3 * t + 2)] - p0));
      if (length(n0 - si.geometric_normal) < 1e-4f) counts[t] += 1.0;
    }
  }
  for (int t = 0; t < 3; ++t) {
    const double p = areas[t] / surfaces.view().total_area;
    EXPECT_NEAR(counts[t] / n, p, 5.0 * std::sqrt(p * (1.0 - p) / n));
  }
}

}  // namespace
}  // namespace octrad
