#include "octrad/geometry/surface_sampling.h"

#include <cmath>
#include <map>
#include <numbers>

#include "octrad/base/cdf.h"
#include "octrad/base/error.h"
#include "octrad/base/memory_limit.h"
#include "octrad/geometry/shape_view.h"

namespace octrad {
namespace {

double triangle_area(const TriangleMesh& mesh, const Vec3i& t) {
  const Vec3f p0 = mesh.positions[static_cast<std::size_t>(t.x)];
  const Vec3d e1(mesh.positions[static_cast<std::size_t>(t.y)] - p0),
      e2(mesh.positions[static_cast<std::size_t>(t.z)] - p0);
  return 0.5 * length(cross(e1, e2));
}

}  // namespace

SurfaceSampler::SurfaceSampler(const Scene& scene, std::span<const int> shapes) : shapes_(shape_views(scene)) {
  double total_area = 0.0;
  std::map<int, std::pair<int, double>> placed;  // mesh -> place in placed_areas_, area
  const auto areas_of = [&](int geometry) {
    const auto [at, inserted] = placed.try_emplace(geometry, static_cast<int>(placed_areas_.size()), 0.0);
    if (!inserted) return at->second;
    const TriangleMesh& mesh = scene.meshes[static_cast<std::size_t>(geometry)];
    std::vector<double> sums;
    ask_memory(mesh.triangles.size() * (sizeof(double) + sizeof(CdfEntry)), scene.file);
    for (const Vec3i& t : mesh.triangles) sums.push_back(at->second.second += triangle_area(mesh, t));
    placed_areas_.push_back(make_cdf(sums));
    return at->second;
  };
  std::vector<bool> wanted(scene.shapes.size(), shapes.empty());
  for (const int s : shapes) wanted[static_cast<std::size_t>(s)] = true;
  for (std::size_t s = 0; s < scene.shapes.size(); ++s) {
    const Shape& shape = scene.shapes[s];
    if (!wanted[s]) continue;
    const auto add = [&](int primitive, double area) {
      if (!(area > 0.0)) return;
      total_area += area;
      elements_.push_back({static_cast<int>(s), primitive});
      cumulative_.push_back(total_area);
    };
    if (shape.kind == Shape::Kind::sphere) {
      const double r = static_cast<double>(scene.spheres[static_cast<std::size_t>(shape.geometry)].radius);
      add(0, 4.0 * std::numbers::pi * r * r);
      continue;
    }
    const TriangleMesh& mesh = scene.meshes[static_cast<std::size_t>(shape.geometry)];
    if (shape.placement >= 0) {
      const float* m = scene.placements[static_cast<std::size_t>(shape.placement)].to_world;
      const double volume = dot(Vec3d(m[0], m[4], m[8]), cross(Vec3d(m[1], m[5], m[9]), Vec3d(m[2], m[6], m[10])));
      const auto [place, area] = areas_of(shape.geometry);
      add(-1 - place, area * std::cbrt(volume * volume));
      continue;
    }
    for (std::size_t t = 0; t < mesh.triangles.size(); ++t)
      add(static_cast<int>(t), triangle_area(mesh, mesh.triangles[t]));
  }
  if (elements_.empty()) throw InputError(scene.file + ": the scene has no surface");
  guide_.resize(elements_.size() + 1);
  std::size_t element = 0;
  for (std::size_t i = 0; i < guide_.size(); ++i) {
    const double start = total_area * static_cast<double>(i) / static_cast<double>(guide_.size());
    while (element + 1 < elements_.size() && cumulative_[element] <= start) ++element;
    guide_[i] = static_cast<std::uint32_t>(element);
  }
  for (const std::vector<CdfEntry>& areas : placed_areas_)
    placed_.push_back({areas.data(), static_cast<int>(areas.size())});
  view_ = {elements_.data(), cumulative_.data(), guide_.data(),  static_cast<std::uint32_t>(elements_.size()),
           total_area,       shapes_.data(),     placed_.data(), static_cast<std::uint32_t>(placed_.size())};
}

SurfaceInteraction SurfaceSampler::sample(float u_pick, Vec2f u) const { return sample_surface(view_, u_pick, u); }
Vec3f SurfaceSampler::sample_position(float u_pick, Vec2f u) const { return sample_surface_position(view_, u_pick, u); }

}  // namespace octrad
