// Points uniform in area over all surfaces, from the tables that SurfaceSampler makes: for host and device.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "octrad/base/cdf_math.h"
#include "octrad/base/rng.h"
#include "octrad/geometry/interaction_math.h"

namespace octrad {

// A triangle or a sphere, as in Hit; or, with the primitive -1 - k, all of a mesh that has a placement, whose areas are
// in SurfaceSamplerView::placed[k].
struct SurfaceElement {
  int shape = -1, primitive = -1;
};

// Areas of a mesh that instances share, before they place it.
struct PlacedMesh {
  const CdfEntry* areas = nullptr;  // [count] of the triangles
  int count = 0;
};

struct SurfaceSamplerView {
  const SurfaceElement* elements = nullptr;
  const double* cumulative = nullptr;  // [count] area up to and including each element
  // [count + 1] first element whose share ends after i / (count + 1) (Chen & Asau 1974).
  const std::uint32_t* guide = nullptr;
  std::uint32_t count = 0;
  double total_area = 0.0;  // square world units
  const ShapeView* shapes = nullptr;
  const PlacedMesh* placed = nullptr;
  std::uint32_t placed_count = 0;
};

// The triangle where `u.x` falls, which becomes a new random number: what is left of it, shifted by `rest`, a number
// that is independent of it.
OCTRAD_HD inline int pick_placed(const PlacedMesh& mesh, float rest, Vec2f& u) {
  const int i = pick_entry(mesh.areas, mesh.count, u.x);
  const float left = (share_of(mesh.areas, i) > 0.0f ? rest_of(mesh.areas, i, u.x) : 0.0f) + rest;
  u.x = std::min(left - std::floor(left), 0.99999994f);
  return i;
}

// `u`: uniform in [0, 1)^2, and so when it is returned.
OCTRAD_HD inline SurfaceElement pick_surface(const SurfaceSamplerView& view, float u_pick, Vec2f& u) {
  const double target = static_cast<double>(u_pick) * view.total_area;
  const auto slot = static_cast<std::uint32_t>(static_cast<double>(u_pick) * static_cast<double>(view.count + 1));
  // Rounding may put the start of the slot just past the target: step back, then forward.
  std::uint32_t i = view.guide[std::min(slot, view.count)];
  while (i > 0 && view.cumulative[i - 1] > target) --i;
  while (i + 1 < view.count && view.cumulative[i] <= target) ++i;
  SurfaceElement element = view.elements[i];
  if (element.primitive < 0) {
    const double below = i > 0 ? view.cumulative[i - 1] : 0.0;
    const auto rest = static_cast<float>((target - below) / (view.cumulative[i] - below));
    element.primitive = pick_placed(view.placed[-1 - element.primitive], rest, u);
  }
  return element;
}

// Barycentric coordinates (u, v) uniform on a triangle (Osada et al. 2002).
OCTRAD_HD inline Vec2f uniform_triangle(Vec2f u) {
  const float r = std::sqrt(1.0f - u.x);
  return {1.0f - r, u.y * r};
}

OCTRAD_HD inline Vec3f uniform_sphere(const Sphere& sphere, Vec2f u) {
  return sphere.center + uniform_direction(u) * sphere.radius;
}

OCTRAD_HD inline SurfaceInteraction sample_surface(const SurfaceSamplerView& view, float u_pick, Vec2f u) {
  const SurfaceElement element = pick_surface(view, u_pick, u);
  const ShapeView& shape = view.shapes[element.shape];
  Hit hit;
  hit.shape = element.shape;
  hit.primitive = element.primitive;
  Vec3f point(0.0f);
  if (shape.sphere != nullptr) {
    point = uniform_sphere(*shape.sphere, u);
  } else {
    const Vec2f b = uniform_triangle(u);
    hit.u = b.x;
    hit.v = b.y;
  }
  return interact(shape, hit, point, Vec3f(0.0f));
}

OCTRAD_HD inline Vec3f sample_surface_position(const SurfaceSamplerView& view, float u_pick, Vec2f u) {
  const SurfaceElement element = pick_surface(view, u_pick, u);
  const ShapeView& shape = view.shapes[element.shape];
  if (shape.sphere != nullptr) return uniform_sphere(*shape.sphere, u);
  const Vec3i triangle = shape.mesh.triangles[element.primitive];
  const Vec2f b = uniform_triangle(u);
  return mesh_position(shape.mesh, triangle.x) * (1.0f - b.x - b.y) + mesh_position(shape.mesh, triangle.y) * b.x +
         mesh_position(shape.mesh, triangle.z) * b.y;
}

}  // namespace octrad
