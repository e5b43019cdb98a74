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
}

SurfaceInteraction SurfaceSampler::sample(float u_pick, Vec2f u) const {
  const auto found = std::upper_bound(cumulative_.begin(), cumulative_.end(), static_cast<double>(u_pick) * total_area_);
  const std::size_t i = std::min(static_cast<std::size_t>(found - cumulative_.begin()), elements_.size() - 1);
  const Element element = elements_[i];
  const Shape& shape = scene_.shapes[static_cast<std::size_t>(element.shape)];
  Hit hit;
  hit.shape = element.shape;
  hit.primitive = element.primitive;
  if (shape.kind == Shape::Kind::mesh) {
    const float r = std::sqrt(1.0f - u.x);  // uniform on a triangle (Osada et al. 2002)
    hit.u = 1.0f - r;
    hit.v = u.y * r;
    return interact(scene_, hit, Vec3f(0.0f), Vec3f(0.0f));
  }
  const Sphere& sphere = scene_.spheres[static_cast<std::size_t>(shape.geometry)];
  const float z = 1.0f - 2.0f * u.x, r = std::sqrt(std::max(0.0f, 1.0f - z * z)), phi = 2.0f * kPi * u.y;
  const Vec3f direction{r * std::cos(phi), r * std::sin(phi), z};
  return interact(scene_, hit, sphere.center + direction * sphere.radius, Vec3f(0.0f));
}

}  // namespace octrad
