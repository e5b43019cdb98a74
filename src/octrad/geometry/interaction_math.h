// Shapes as plain pointers, and the geometry of a hit point on them: for host and device.
#pragma once

#include <algorithm>
#include <cmath>

#include "octrad/base/frame.h"
#include "octrad/geometry/hit.h"
#include "octrad/geometry/surface_interaction.h"
#include "octrad/scene/placement.h"
#include "octrad/scene/sphere.h"

namespace octrad {

// An indexed triangle mesh (scene/scene.h: TriangleMesh), in world space where it has no placement.
struct MeshView {
  const Vec3f* positions = nullptr;
  const Vec3f* normals = nullptr;  // per vertex; null: face normals
  const Vec2f* uvs = nullptr;      // per vertex; null: barycentric coordinates
  const Vec3i* triangles = nullptr;
  bool flip_normals = false;
  const Placement* placement = nullptr;
};

OCTRAD_HD inline Vec3f mesh_position(const MeshView& mesh, int vertex) {
  const Vec3f p = mesh.positions[vertex];
  return mesh.placement == nullptr ? p : mesh.placement->point(p);
}

struct ShapeView {
  MeshView mesh;
  const Sphere* sphere = nullptr;  // null: the shape is the mesh
  int material = -1, emitter = -1;
};

// Tangents of a triangle: p = p0 + du (u - u0) + dv (v - v0). Without uv, or where they are degenerate, as Mitsuba 3:
// barycentric coordinates, or any frame around the normal.
OCTRAD_HD inline void triangle_interaction(const MeshView& mesh, const Hit& hit, SurfaceInteraction& s) {
  const Vec3i triangle = mesh.triangles[hit.primitive];
  const Vec3f p0 = mesh_position(mesh, triangle.x), p1 = mesh_position(mesh, triangle.y),
              p2 = mesh_position(mesh, triangle.z);
  const float b1 = hit.u, b2 = hit.v, b0 = 1.0f - b1 - b2;
  const Vec3f e1 = p1 - p0, e2 = p2 - p0;
  s.position = p0 * b0 + p1 * b1 + p2 * b2;
  Vec3f n = cross(e1, e2);
  float l = length(n);
  if (!(l > 1e-18f)) {
    // The product of two short edges can leave the range of float although the triangle has an area.
    const Vec3d exact = cross(Vec3d(e1), Vec3d(e2));
    const double exact_length = length(exact);
    n = exact_length > 0.0 ? Vec3f(exact / exact_length) : Vec3f(0, 0, 1);
    l = 1.0f;
  }
  n = n / l;
  // Normals keep their side of the surface, whichever way round the triangle goes.
  if (mesh.placement != nullptr && mesh.placement->mirrors) n = -n;
  s.uv = {b1, b2};
  s.dp_du = e1;
  s.dp_dv = e2;
  if (mesh.uvs != nullptr) {
    const Vec2f uv0 = mesh.uvs[triangle.x], uv1 = mesh.uvs[triangle.y], uv2 = mesh.uvs[triangle.z];
    s.uv = uv0 * b0 + uv1 * b1 + uv2 * b2;
    const Vec2f d1 = uv1 - uv0, d2 = uv2 - uv0;
    const float determinant = d1.x * d2.y - d1.y * d2.x;
    if (determinant != 0.0f) {
      const float inverse = 1.0f / determinant;
      s.dp_du = (e1 * d2.y - e2 * d1.y) * inverse;
      s.dp_dv = (e2 * d1.x - e1 * d2.x) * inverse;
    }
    if (determinant == 0.0f || !is_finite(s.dp_du) || !is_finite(s.dp_dv)) {
      const Frame frame = make_frame(n);
      s.dp_du = frame.s;
      s.dp_dv = frame.t;
    }
  }
  s.geometric_normal = s.shading_normal = n;
  if (mesh.normals != nullptr) {
    Vec3f interpolated = mesh.normals[triangle.x] * b0 + mesh.normals[triangle.y] * b1 + mesh.normals[triangle.z] * b2;
    if (mesh.placement != nullptr) interpolated = mesh.placement->normal(interpolated);
    const float length_squared = dot(interpolated, interpolated);
    if (length_squared > 1e-12f) s.shading_normal = interpolated / std::sqrt(length_squared);
  }
  if (mesh.flip_normals) {
    s.geometric_normal = -s.geometric_normal;
    s.shading_normal = -s.shading_normal;
  }
}

// `point` is projected onto the sphere. u = azimuth / 2 pi around the sphere's own z axis, v = polar angle / pi from
// it.
OCTRAD_HD inline void sphere_interaction(const Sphere& sphere, Vec3f point, SurfaceInteraction& s) {
  const Vec3f outward = normalize(point - sphere.center);
  s.position = sphere.center + outward * sphere.radius;
  const float* m = sphere.to_local;
  const Vec3f row0{m[0], m[1], m[2]}, row1{m[3], m[4], m[5]}, row2{m[6], m[7], m[8]};
  const Vec3f local{dot(row0, outward), dot(row1, outward), dot(row2, outward)};
  const float sin_theta = std::sqrt(local.x * local.x + local.y * local.y);
  float phi = std::atan2(local.y, local.x);
  if (phi < 0.0f) phi += 2.0f * kPi;
  // atan2 keeps its precision at the poles, where acos(z) loses it.
  s.uv = {std::min(phi * (0.5f * kInvPi), 1.0f), std::atan2(sin_theta, local.z) * kInvPi};
  const bool pole = !(sin_theta > 0.0f);
  const Vec3f azimuth = pole ? Vec3f(1, 0, 0) : Vec3f(local.x / sin_theta, local.y / sin_theta, 0.0f);
  const Vec3f around = pole ? Vec3f(0, 1, 0) : Vec3f(-local.y, local.x, 0.0f);
  const Vec3f down{local.z * azimuth.x, local.z * azimuth.y, -sin_theta};
  const float circle = 2.0f * kPi * sphere.radius;
  s.dp_du = (row0 * around.x + row1 * around.y + row2 * around.z) * (pole ? circle * 1e-6f : circle);
  s.dp_dv = (row0 * down.x + row1 * down.y + row2 * down.z) * (kPi * sphere.radius);
  s.geometric_normal = s.shading_normal = sphere.flip_normals ? -outward : outward;
}

// The ray (origin, direction) is used for spheres only.
OCTRAD_HD inline SurfaceInteraction interact(const ShapeView& shape, const Hit& hit, Vec3f origin, Vec3f direction) {
  SurfaceInteraction s;
  s.t = hit.t;
  s.shape = hit.shape;
  s.material = shape.material;
  s.emitter = shape.emitter;
  if (shape.sphere != nullptr) {
    sphere_interaction(*shape.sphere, origin + direction * hit.t, s);
  } else {
    triangle_interaction(shape.mesh, hit, s);
  }
  return s;
}

}  // namespace octrad
