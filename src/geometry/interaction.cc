#include <algorithm>
#include <cmath>

#include "base/frame.h"
#include "geometry/tracer.h"

namespace octrad {
namespace {

// Tangents of a triangle: p = p0 + du (u - u0) + dv (v - v0). Without uv, or where they are degenerate, as Mitsuba 3:
// barycentric coordinates, or any frame around the normal.
void triangle_interaction(const TriangleMesh& mesh, const Hit& hit, SurfaceInteraction& s) {
  const Vec3i triangle = mesh.triangles[static_cast<std::size_t>(hit.primitive)];
  const auto i0 = static_cast<std::size_t>(triangle.x), i1 = static_cast<std::size_t>(triangle.y), i2 = static_cast<std::size_t>(triangle.z);
  const Vec3f p0 = mesh.positions[i0], p1 = mesh.positions[i1], p2 = mesh.positions[i2];
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
  s.uv = {b1, b2};
  s.dp_du = e1;
  s.dp_dv = e2;
  if (!mesh.uvs.empty()) {
    const Vec2f uv0 = mesh.uvs[i0], uv1 = mesh.uvs[i1], uv2 = mesh.uvs[i2];
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
  if (!mesh.normals.empty()) {
    const Vec3f interpolated = mesh.normals[i0] * b0 + mesh.normals[i1] * b1 + mesh.normals[i2] * b2;
    const float length_squared = dot(interpolated, interpolated);
    if (length_squared > 1e-12f) s.shading_normal = interpolated / std::sqrt(length_squared);
  }
  if (mesh.flip_normals) {
    s.geometric_normal = -s.geometric_normal;
    s.shading_normal = -s.shading_normal;
  }
}

// u = azimuth / 2 pi around the sphere's own z axis, v = polar angle / pi from it.
void sphere_interaction(const Sphere& sphere, Vec3f point, SurfaceInteraction& s) {
  const Vec3f outward = normalize(point - sphere.center);
  s.position = sphere.center + outward * sphere.radius;
  const float* m = sphere.to_local;
  const auto to_local = [m](Vec3f v) {
    return Vec3f(m[0] * v.x + m[1] * v.y + m[2] * v.z, m[3] * v.x + m[4] * v.y + m[5] * v.z, m[6] * v.x + m[7] * v.y + m[8] * v.z);
  };
  const auto to_world = [m](Vec3f v) {
    return Vec3f(m[0] * v.x + m[3] * v.y + m[6] * v.z, m[1] * v.x + m[4] * v.y + m[7] * v.z, m[2] * v.x + m[5] * v.y + m[8] * v.z);
  };
  const Vec3f local = to_local(outward);
  const float sin_theta = std::sqrt(local.x * local.x + local.y * local.y);
  float phi = std::atan2(local.y, local.x);
  if (phi < 0.0f) phi += 2.0f * kPi;
  // atan2 keeps its precision at the poles, where acos(z) loses it.
  s.uv = {std::min(phi * (0.5f * kInvPi), 1.0f), std::atan2(sin_theta, local.z) * kInvPi};
  const Vec3f azimuth = sin_theta > 0.0f ? Vec3f(local.x / sin_theta, local.y / sin_theta, 0.0f) : Vec3f(1, 0, 0);
  s.dp_du = sin_theta > 0.0f ? to_world({-local.y, local.x, 0.0f}) * (2.0f * kPi * sphere.radius) : to_world({0, 1, 0}) * (2.0f * kPi * sphere.radius * 1e-6f);
  s.dp_dv = to_world({local.z * azimuth.x, local.z * azimuth.y, -sin_theta}) * (kPi * sphere.radius);
  s.geometric_normal = s.shading_normal = sphere.flip_normals ? -outward : outward;
}

}  // namespace

SurfaceInteraction interact(const Scene& scene, const Hit& hit, Vec3f origin, Vec3f direction) {
  SurfaceInteraction s;
  s.t = hit.t;
  s.shape = hit.shape;
  const Shape& shape = scene.shapes[static_cast<std::size_t>(hit.shape)];
  s.material = shape.material;
  s.emitter = shape.emitter;
  if (shape.kind == Shape::Kind::sphere) {
    sphere_interaction(scene.spheres[static_cast<std::size_t>(shape.geometry)], origin + direction * hit.t, s);
  } else {
    triangle_interaction(scene.meshes[static_cast<std::size_t>(shape.geometry)], hit, s);
  }
  return s;
}

}  // namespace octrad
