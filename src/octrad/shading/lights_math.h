// Sampling of emitters and its densities, over the tables that Lights makes (shading/lights.h): for host and device.
#pragma once

#include <algorithm>
#include <cmath>

#include "octrad/base/cdf_math.h"
#include "octrad/base/frame.h"
#include "octrad/base/rng.h"
#include "octrad/geometry/interaction_math.h"
#include "octrad/scene/texture_math.h"
#include "octrad/shading/delta_lights_math.h"
#include "octrad/shading/environment_math.h"
#include "octrad/shading/light_sample.h"
#include "octrad/shading/square_maps.h"

namespace octrad {

struct LightTriangle {
  Vec3f p0, e1, e2;
  Vec3f normal;  // unit, on the emitting side
};

// One area light: a whole mesh or sphere.
struct LightRecord {
  ShapeView shape;
  int shape_index = -1;
  int texture = -1;  // of radiance; -1: the same everywhere
  Vec3f radiance;    // times the texture where there is one
  const LightTriangle* triangles = nullptr;
  const CdfEntry* cdf = nullptr;  // [triangle_count] of triangle areas
  int triangle_count = 0;
  bool parallelogram = false;  // which the first triangle's edges span, alone
  float inv_area = 0.0f;
  float pick = 0.0f;  // probability of this emitter
  float side = 1.0f;  // of a sphere; -1: emits inwards
  // Cells of a parallelogram that shows a picture over [0, 1]^2, drawn by how bright they are.
  const CdfEntry* grid = nullptr;  // [grid_side][grid_side]
  int grid_side = 0;
};

struct LightsView {
  const LightRecord* area = nullptr;
  const TextureView* textures = nullptr;
  const DeltaLight* delta = nullptr;
  int area_count = 0, delta_count = 0;
  int count = 0;                  // area lights, lights without extent, the environment
  const CdfEntry* cdf = nullptr;  // [count] of the probabilities of picking them
  float environment_pick = 0.0f;
  EnvironmentView environment;                 // without pixels where there is none
  Vec3f environment_factor{1.0f, 1.0f, 1.0f};  // of its radiance; densities do not know it

  OCTRAD_HD bool has_environment() const { return environment.pixels != nullptr; }
};

namespace lights_detail {

// Radiance of a light where its texture has these coordinates.
OCTRAD_HD inline Vec3f light_radiance(const LightsView& view, const LightRecord& l, Vec2f uv) {
  return l.texture >= 0 ? evaluate_texture(view.textures[l.texture], uv) * l.radiance : l.radiance;
}

OCTRAD_HD inline Vec2f mesh_uv(const MeshView& mesh, int triangle, Vec2f b) {
  if (mesh.uvs == nullptr) return b;
  const Vec3i t = mesh.triangles[triangle];
  const Vec2f a = mesh.uvs[t.x];
  return a + (mesh.uvs[t.y] - a) * b.x + (mesh.uvs[t.z] - a) * b.y;
}

// The normal at a point of a triangle, as interact() computes it.
OCTRAD_HD inline Vec3f interpolated_normal(const MeshView& mesh, int triangle, Vec2f b, Vec3f otherwise) {
  const Vec3i t = mesh.triangles[triangle];
  const Vec3f n = mesh.normals[t.x] * (1.0f - b.x - b.y) + mesh.normals[t.y] * b.x + mesh.normals[t.z] * b.y;
  const float l2 = dot(n, n);
  if (!(l2 > 1e-12f)) return otherwise;
  return n * ((mesh.flip_normals ? -1.0f : 1.0f) / std::sqrt(l2));
}

// Half-angle of the cone under which a sphere is seen: 1 - cos, accurate for small spheres far away.
OCTRAD_HD inline float one_minus_cos_max(float radius, float distance2) {
  const float sin2 = std::min(1.0f, radius * radius / distance2);
  return sin2 / (1.0f + std::sqrt(1.0f - sin2));
}

// How much likelier a point with these coordinates is drawn than uniformly by area.
OCTRAD_HD inline float grid_density(const LightRecord& l, Vec2f uv) {
  const auto cell = [&l](float x) {
    return std::max(0, std::min(static_cast<int>(x * static_cast<float>(l.grid_side)), l.grid_side - 1));
  };
  return share_of(l.grid, cell(uv.y) * l.grid_side + cell(uv.x)) * static_cast<float>(l.grid_side * l.grid_side);
}

// Barycentric coordinates (b1, b2) of texture coordinates in a triangle, which may lie outside of it.
OCTRAD_HD inline Vec2f barycentric_of_uv(const MeshView& mesh, int triangle, Vec2f uv) {
  const Vec3i t = mesh.triangles[triangle];
  const Vec2f p = uv - mesh.uvs[t.x], e1 = mesh.uvs[t.y] - mesh.uvs[t.x], e2 = mesh.uvs[t.z] - mesh.uvs[t.x];
  const float determinant = e1.x * e2.y - e1.y * e2.x;
  return {(p.x * e2.y - p.y * e2.x) / determinant, (e1.x * p.y - e1.y * p.x) / determinant};
}

// A point of the grid: triangle and barycentric coordinates. Returns grid_density() there.
OCTRAD_HD inline float sample_grid(const LightRecord& l, Vec2f u, int& triangle, Vec2f& b) {
  const int i = pick_entry(l.grid, l.grid_side * l.grid_side, u.x);
  const float share = share_of(l.grid, i);
  u.x = share > 0.0f ? rest_of(l.grid, i, u.x) : 0.5f;
  const int row = i / l.grid_side, column = i % l.grid_side;
  const auto side = static_cast<float>(l.grid_side);
  const Vec2f uv{(static_cast<float>(column) + u.x) / side, (static_cast<float>(row) + u.y) / side};
  triangle = 0;
  b = barycentric_of_uv(l.shape.mesh, 0, uv);
  if (!(b.x >= 0.0f && b.y >= 0.0f && b.x + b.y <= 1.0f)) b = barycentric_of_uv(l.shape.mesh, triangle = 1, uv);
  return share * side * side;
}

// What turns density by area on a lamp into density by solid angle, along a direction to it, times its length; 0: its
// back, or its edge. The shading normal says which side emits. The cosine is that of the shading normal as well where
// all of the lamp is alike, and that of the face where it has a texture, both as in Mitsuba.
OCTRAD_HD inline float lamp_cosine(const LightRecord& l, Vec3f direction, Vec3f shading_normal, Vec3f face_normal) {
  const float cos = -dot(direction, shading_normal);
  return cos > 0.0f && l.texture >= 0 ? std::fabs(dot(direction, face_normal)) : cos;
}

OCTRAD_HD inline LightSample sample_mesh(const LightsView& view, const LightRecord& l, float pick, Vec3f x, Vec2f u) {
  LightSample s;
  if (l.triangle_count == 0) return s;
  int i = 0;
  Vec2f b;
  float density = 1.0f;
  if (l.grid != nullptr) {
    density = sample_grid(l, u, i, b);
  } else if (l.parallelogram) {
    b = u;
  } else {
    i = pick_entry(l.cdf, l.triangle_count, u.x);
    if (!(share_of(l.cdf, i) > 0.0f)) return s;
    u.x = rest_of(l.cdf, i, u.x);
    b = square_to_triangle(u);
  }
  const LightTriangle& t = l.triangles[i];
  const Vec3f d = t.p0 + t.e1 * b.x + t.e2 * b.y - x;
  const float distance2 = dot(d, d);
  s.distance = std::sqrt(distance2);
  if (!(s.distance > 0.0f)) return s;
  s.direction = d / s.distance;
  const MeshView& mesh = l.shape.mesh;
  const float cos = lamp_cosine(
      l, s.direction, mesh.normals == nullptr ? t.normal : interpolated_normal(mesh, i, b, t.normal), t.normal);
  if (!(cos > 0.0f)) return s;
  s.pdf = pick * l.inv_area * distance2 / cos * density;
  s.radiance = l.texture >= 0 ? light_radiance(view, l, mesh_uv(mesh, i, b)) : l.radiance;
  s.valid = s.pdf > 0.0f && std::isfinite(s.pdf);  // 0: a mesh without area
  return s;
}

OCTRAD_HD inline LightSample sample_sphere(const LightsView& view, const LightRecord& l, float pick, Vec3f x, Vec2f u) {
  LightSample s;
  const Vec3f center = l.shape.sphere->center;
  const float radius = l.shape.sphere->radius;
  const Vec3f d = center - x;
  const float distance2 = dot(d, d);
  if (distance2 > radius * radius * (1.0f + 1e-4f)) {
    if (l.side < 0.0f) return s;
    const float range = one_minus_cos_max(radius, distance2);
    const float one_minus_cos = u.x * range, cos = 1.0f - one_minus_cos;
    const float sin2 = one_minus_cos * (1.0f + cos);
    const Vec2f across = circle_point(u.y) * std::sqrt(std::max(0.0f, sin2));
    const Frame frame = make_frame(d / std::sqrt(distance2));
    s.direction = frame.to_world({across.x, across.y, cos});
    // Nearer root of |x + t w - c| = r with h = r^2 - (distance sin)^2.
    const float h = std::max(0.0f, radius * radius - distance2 * sin2);
    s.distance = std::sqrt(distance2) * cos - std::sqrt(h);
    s.pdf = pick / (2.0f * kPi * range);
  } else {
    if (l.side > 0.0f) return s;  // inside (or on) a sphere that emits outwards
    const Vec3f n = uniform_direction(u);
    const Vec3f e = center + n * radius - x;
    s.distance = length(e);
    if (!(s.distance > 0.0f)) return s;
    s.direction = e / s.distance;
    const float cos = dot(s.direction, n);
    if (!(cos > 0.0f)) return s;
    s.pdf = pick * l.inv_area * s.distance * s.distance / cos;
  }
  s.valid = s.distance > 0.0f && std::isfinite(s.pdf);
  s.radiance = l.radiance;
  if (l.texture >= 0 && s.valid) {
    SurfaceInteraction surface;
    sphere_interaction(*l.shape.sphere, x + s.direction * s.distance, surface);
    s.radiance = light_radiance(view, l, surface.uv);
  }
  return s;
}

}  // namespace lights_detail

OCTRAD_HD inline int pick_light(const LightsView& view, float u_pick) {
  return pick_entry(view.cdf, view.count, u_pick);
}

// Probability of picking emitter `i`.
OCTRAD_HD inline float light_pick(const LightsView& view, int i) { return share_of(view.cdf, i); }

OCTRAD_HD inline LightSample environment_light(const LightsView& view, float pick, const EnvironmentSample& e) {
  LightSample s;
  s.direction = e.direction;
  s.distance = kEnvironmentDistance;
  s.radiance = e.radiance * view.environment_factor;
  s.pdf = pick * e.pdf;
  s.valid = e.pdf > 0.0f;
  return s;
}

// Draws a point on emitter `i`, picked with probability `pick`, as seen from `x`.
OCTRAD_HD inline LightSample sample_picked_light(const LightsView& view, int i, float pick, Vec3f x, Vec2f u) {
  if (i < view.area_count) {
    const LightRecord& l = view.area[i];
    return l.shape.sphere != nullptr ? lights_detail::sample_sphere(view, l, pick, x, u)
                                     : lights_detail::sample_mesh(view, l, pick, x, u);
  }
  if (i - view.area_count < view.delta_count)
    return sample_delta_light(view.delta[i - view.area_count], view.textures, pick, x);
  return environment_light(view, pick, sample_environment(view.environment, x, u));
}

// Draws a point on an emitter as seen from `x`.
OCTRAD_HD inline LightSample sample_light(const LightsView& view, Vec3f x, float u_pick, Vec2f u) {
  if (view.count == 0) return {};
  const int i = pick_light(view, u_pick);
  return sample_picked_light(view, i, light_pick(view, i), x, u);
}

// Radiance leaving a hit emitter towards `wo`, zero on its back and from surfaces that are none.
OCTRAD_HD inline Vec3f light_emitted(const LightsView& view, const SurfaceInteraction& surface, Vec3f wo) {
  if (surface.emitter < 0 || !(dot(surface.shading_normal, wo) > 0.0f)) return Vec3f(0.0f);
  return lights_detail::light_radiance(view, view.area[surface.emitter], surface.uv);
}

// The density that sample_light() has for a hit emitter from `x`.
OCTRAD_HD inline float light_pdf(const LightsView& view, Vec3f x, const SurfaceInteraction& surface) {
  if (surface.emitter < 0) return 0.0f;
  const LightRecord& l = view.area[surface.emitter];
  if (l.shape.sphere != nullptr) {
    const float radius = l.shape.sphere->radius;
    const Vec3f d = l.shape.sphere->center - x;
    const float distance2 = dot(d, d);
    if (distance2 > radius * radius * (1.0f + 1e-4f)) {
      return l.side < 0.0f ? 0.0f : l.pick / (2.0f * kPi * lights_detail::one_minus_cos_max(radius, distance2));
    }
    if (l.side > 0.0f) return 0.0f;
  }
  const Vec3f d = surface.position - x;
  const float distance2 = dot(d, d);
  const float cos =
      lights_detail::lamp_cosine(l, d, surface.shading_normal, surface.geometric_normal) / std::sqrt(distance2);
  if (!(cos > 0.0f)) return 0.0f;
  const float pdf = l.pick * l.inv_area * distance2 / cos;
  return l.grid == nullptr ? pdf : pdf * lights_detail::grid_density(l, surface.uv);
}

// Radiance of the environment along a unit direction that hit nothing, and the density of sample_light() from `x` for
// it.
OCTRAD_HD inline Vec3f light_environment(const LightsView& view, Vec3f direction) {
  return view.has_environment() ? environment_radiance(view.environment, direction) * view.environment_factor
                                : Vec3f(0.0f);
}
OCTRAD_HD inline float light_environment_pdf(const LightsView& view, Vec3f x, Vec3f direction) {
  return view.has_environment() ? view.environment_pick * environment_pdf(view.environment, x, direction) : 0.0f;
}
OCTRAD_HD inline Vec3f light_environment(const LightsView& view, Vec3f x, Vec3f direction, float& pdf) {
  if (!view.has_environment()) {
    pdf = 0.0f;
    return Vec3f(0.0f);
  }
  const Vec3f radiance = environment_radiance(view.environment, x, direction, pdf);
  pdf *= view.environment_pick;
  return radiance * view.environment_factor;
}

}  // namespace octrad
