#include "octrad/geometry/surface_sampling.h"

#include "octrad/base/error.h"
#include "octrad/geometry/shape_view.h"

namespace octrad {

SurfaceSampler::SurfaceSampler(const Scene& scene) : shapes_(shape_views(scene)) {
  double total_area = 0.0;
  for (std::size_t s = 0; s < scene.shapes.size(); ++s) {
    const Shape& shape = scene.shapes[s];
    const auto add = [&](int primitive, double area) {
      if (!(area > 0.0)) return;
      total_area += area;
      elements_.push_back({static_cast<int>(s), primitive});
      cumulative_.push_back(total_area);
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
      const Vec3d e1(mesh.positions[static_cast<std::size_t>(tri.y)] - p0),
          e2(mesh.positions[static_cast<std::size_t>(tri.z)] - p0);
      add(static_cast<int>(t), 0.5 * length(cross(e1, e2)));
    }
  }
  if (elements_.empty()) throw InputError(scene.file + ": the scene has no surface");
  guide_.resize(elements_.size() + 1);
  std::size_t element = 0;
  for (std::size_t i = 0; i < guide_.size(); ++i) {
    const double start = total_area * static_cast<double>(i) / static_cast<double>(guide_.size());
    while (element + 1 < elements_.size() && cumulative_[element] <= start) ++element;
    guide_[i] = static_cast<std::uint32_t>(element);
  }
  view_ = {elements_.data(), cumulative_.data(), guide_.data(), static_cast<std::uint32_t>(elements_.size()),
           total_area,       shapes_.data()};
}

SurfaceInteraction SurfaceSampler::sample(float u_pick, Vec2f u) const { return sample_surface(view_, u_pick, u); }
Vec3f SurfaceSampler::sample_position(float u_pick, Vec2f u) const { return sample_surface_position(view_, u_pick, u); }

}  // namespace octrad
