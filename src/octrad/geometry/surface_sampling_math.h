// Points uniform in area over all surfaces, from the tables that SurfaceSampler makes: for host and device.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "octrad/geometry/interaction_math.h"

namespace octrad {

// A triangle or a sphere, as in Hit.
struct SurfaceElement {
  int shape = -1, primitive = -1;
};

struct SurfaceSamplerView {
  const SurfaceElement* elements = nullptr;
  const double* cumulative = nullptr;  // [count] area up to and including each element
  const std::uint32_t* guide =
      nullptr;  // [count + 1] first element whose share ends after i / (count + 1) (Chen & Asau 1974)
  std::uint32_t count = 0;
  double total_area = 0.0;
  const ShapeView* shapes = nullptr;
};

OCTRAD_HD inline SurfaceElement pick_surface(const SurfaceSamplerView& view, float u_pick) {
  const double target = static_cast<double>(u_pick) * view.total_area;
  const auto slot = static_cast<std::uint32_t>(static_cast<double>(u_pick) * static_cast<double>(view.count + 1));
  // Rounding may put the start of the slot just past the target: step back, then forward.
  std::uint32_t i = view.guide[std::min(slot, view.count)];
  while (i > 0 && view.cumulative[i - 1] > target) --i;
  while (i + 1 < view.count && view.cumulative[i] <= target) ++i;
  return view.elements[i];
}

// Barycentric coordinates (u, v) uniform on a triangle (Osada et al. 2002).
OCTRAD_HD inline Vec2f uniform_triangle(Vec2f u) {
  const float r = std::sqrt(1.0f - u.x);
  return {1.0f - r, u.y * r};
}

OCTRAD_HD inline Vec3f uniform_sphere(const Sphere& sphere, Vec2f u) {
  const float z = 1.0f - 2.0f * u.x, r = std::sqrt(std::max(0.0f, 1.0f - z * z)), phi = 2.0f * kPi * u.y;
  return sphere.center + Vec3f(r * std::cos(phi), r * std::sin(phi), z) * sphere.radius;
}

OCTRAD_HD inline SurfaceInteraction sample_surface(const SurfaceSamplerView& view, float u_pick, Vec2f u) {
  const SurfaceElement element = pick_surface(view, u_pick);
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
  const SurfaceElement element = pick_surface(view, u_pick);
  const ShapeView& shape = view.shapes[element.shape];
  if (shape.sphere != nullptr) return uniform_sphere(*shape.sphere, u);
  const Vec3i triangle = shape.mesh.triangles[element.primitive];
  const Vec2f b = uniform_triangle(u);
  const Vec3f* positions = shape.mesh.positions;
  return positions[triangle.x] * (1.0f - b.x - b.y) + positions[triangle.y] * b.x + positions[triangle.z] * b.y;
}

}  // namespace octrad
