// Views of a scene's shapes for the maths of hit points. They hold as long as the scene's arrays stay where they are.
#pragma once

#include <vector>

#include "octrad/geometry/interaction_math.h"
#include "octrad/scene/scene.h"

namespace octrad {

inline MeshView mesh_view(const TriangleMesh& mesh) {
  const Vec3f* normals = mesh.normals.empty() || mesh.flat ? nullptr : mesh.normals.data();
  const Vec2f* uvs = mesh.uvs.empty() ? nullptr : mesh.uvs.data();
  return {mesh.positions.data(), normals, uvs, mesh.triangles.data(), mesh.flip_normals, nullptr};
}

inline ShapeView shape_view(const Scene& scene, std::size_t index) {
  const Shape& shape = scene.shapes[index];
  const auto geometry = static_cast<std::size_t>(shape.geometry);
  ShapeView view;
  if (shape.kind == Shape::Kind::sphere) {
    view.sphere = &scene.spheres[geometry];
  } else {
    view.mesh = mesh_view(scene.meshes[geometry]);
    if (shape.placement >= 0) view.mesh.placement = &scene.placements[static_cast<std::size_t>(shape.placement)];
  }
  view.material = shape.material;
  view.emitter = shape.emitter;
  return view;
}

// Views of all shapes, by index.
inline std::vector<ShapeView> shape_views(const Scene& scene) {
  std::vector<ShapeView> views(scene.shapes.size());
  for (std::size_t i = 0; i < views.size(); ++i) views[i] = shape_view(scene, i);
  return views;
}

}  // namespace octrad
