#include "geometry/surface_sampling.h"

#include <algorithm>
#include <cmath>

#include "base/error.h"

namespace octrad {

SurfaceSampler::SurfaceSampler(const Scene& scene) : scene_(scene) {
  for (std::size_t s = 0; s < scene.shapes.size(); ++s) {
    const Shape& shape = scene.shapes[s];
    const auto add = [&](int primitive, double area) {
      if (!(area > 0.0)) return;
      total_area_ += area;
      elements_.push_back({static_cast<int>(s), primitive});
      cumulative_.push_back(total_area_);
    };
    if (shape.kind == Shape::Kind::sphere) {
      const double r = static_cast<double>(scene.spheres[static_cast<std::size_t>(shape.geometry)].radius);
      add(0, 4.0 * 3.14159265358979323846 * r * r);
      continue;
    }
    const TriangleMesh& mesh = scene.meshes[static_cast<std::size_t>(shape.geometry)];
    for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
      const Vec3i tri = mesh.triangles[t];
      const Vec3f p0 = mesh.positions[static_cast<std::size_t>(tri.x)];
      const Vec3d e1(mesh.positions[static_cast<std::size_t>(tri.y)] - p0), e2(mesh.positions[static_cast<std::size_t>(tri.z)] - p0);
      add(static_cast<int>(t), 0.5 * length(cross(e1, e2)));
    }
  }
  if (elements_.empty()) throw InputError(scene.file + ": the scene has no surface");
  guide_.resize(elements_.size() + 1);
  std::size_t element = 0;
  for (std::size_t i = 0; i < guide_.size(); ++i) {
    const double start = total_area_ * static_cast<double>(i) / static_cast<double>(guide_.size());
    while (element + 1 < elements_.size() && cumulative_[element] <= start) ++element;
    guide_[i] = static_cast<std::uint32_t>(element);
  }
}

SurfaceSampler::Element SurfaceSampler::pick(float u_pick) const {
  const double target = static_cast<double>(u_pick) * total_area_;
  const std::size_t slot = std::min(static_cast<std::size_t>(static_cast<double>(u_pick) * static_cast<double>(guide_.size())), guide_.size() - 1);
  // Rounding may put the start of the slot just past the target: step back, then forward.
  std::size_t i = guide_[slot];
  while (i > 0 && cumulative_[i - 1] > target) --i;
  while (i + 1 < elements_.size() && cumulative_[i] <= target) ++i;
  return elements_[i];
}

namespace {

// Barycentric coordinates (u, v) uniform on a triangle (Osada et al. 2002).
Vec2f uniform_triangle(Vec2f u) {
  const float r = std::sqrt(1.0f - u.x);
  return {1.0f - r, u.y * r};
}

Vec3f uniform_sphere(const Sphere& sphere, Vec2f u) {
  const float z = 1.0f - 2.0f * u.x, r = std::sqrt(std::max(0.0f, 1.0f - z * z)), phi = 2.0f * kPi * u.y;
  return sphere.center + Vec3f(r * std::cos(phi), r * std::sin(phi), z) * sphere.radius;
}

}  // namespace

SurfaceInteraction SurfaceSampler::sample(float u_pick, Vec2f u) const {
  const Element element = pick(u_pick);
  const Shape& shape = scene_.shapes[static_cast<std::size_t>(element.shape)];
  Hit hit;
  hit.shape = element.shape;
  hit.primitive = element.primitive;
  if (shape.kind == Shape::Kind::sphere) {
    return interact(scene_, hit, uniform_sphere(scene_.spheres[static_cast<std::size_t>(shape.geometry)], u), Vec3f(0.0f));
  }
  const Vec2f b = uniform_triangle(u);
  hit.u = b.x;
  hit.v = b.y;
  return interact(scene_, hit, Vec3f(0.0f), Vec3f(0.0f));
}

Vec3f SurfaceSampler::sample_position(float u_pick, Vec2f u) const {
  const Element element = pick(u_pick);
  const Shape& shape = scene_.shapes[static_cast<std::size_t>(element.shape)];
  if (shape.kind == Shape::Kind::sphere) return uniform_sphere(scene_.spheres[static_cast<std::size_t>(shape.geometry)], u);
  const TriangleMesh& mesh = scene_.meshes[static_cast<std::size_t>(shape.geometry)];
  const Vec3i triangle = mesh.triangles[static_cast<std::size_t>(element.primitive)];
  const Vec2f b = uniform_triangle(u);
  return mesh.positions[static_cast<std::size_t>(triangle.x)] * (1.0f - b.x - b.y) + mesh.positions[static_cast<std::size_t>(triangle.y)] * b.x +
         mesh.positions[static_cast<std::size_t>(triangle.z)] * b.y;
}

}  // namespace octrad
