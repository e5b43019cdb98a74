// The triangles and spheres of a scene's shapes, numbered one after the other.
#pragma once

#include <cstddef>
#include <vector>

#include "octrad/scene/scene.h"

namespace octrad {

// The number of each shape's first triangle, of every instance, or sphere; behind the last shape, how many there are.
inline std::vector<std::size_t> first_primitives(const Scene& scene) {
  std::vector<std::size_t> first(scene.shapes.size() + 1, 0);
  for (std::size_t i = 0; i < scene.shapes.size(); ++i) {
    const Shape& shape = scene.shapes[i];
    const bool sphere = shape.kind == Shape::Kind::sphere;
    first[i + 1] = first[i] + (sphere ? 1 : scene.meshes[static_cast<std::size_t>(shape.geometry)].triangles.size());
  }
  return first;
}

}  // namespace octrad
