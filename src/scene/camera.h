// Perspective camera. Mitsuba's convention: camera space looks along +z, +x to the left of the picture, +y up.
#pragma once

#include "base/vec.h"

namespace octrad {

struct Ray {
  Vec3f origin, direction;         // direction has unit length
};

struct Camera {
  Vec3f origin{0, 0, 0};
  Vec3f right{1, 0, 0}, up{0, 1, 0}, forward{0, 0, 1};  // unit; `right` points to the right of the picture
  float fov_degrees = 45.0f;       // along fov_axis
  enum class FovAxis { x, y, diagonal, smaller, larger };
  FovAxis fov_axis = FovAxis::x;
  float near_clip = 0.01f, far_clip = 10000.0f;
  Vec2f principal_point_offset{0, 0};
  int film_width = 0, film_height = 0;

  // Ray through `pixel` (continuous, [0, width] x [0, height], row 0 at the top) of a width x height picture.
  Ray generate(Vec2f pixel, int width, int height) const;
};

// Camera at `origin` looking at `target`.
Camera look_at(Vec3f origin, Vec3f target, Vec3f up, float fov_degrees, Camera::FovAxis axis);

}  // namespace octrad
