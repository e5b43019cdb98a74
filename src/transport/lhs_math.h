// One left-hand-side point (transport/lhs_sampler.h), for host and device.
#pragma once

#include <cmath>

#include "scene/camera_math.h"
#include "transport/follow_math.h"

namespace octrad {

// Shares of the three kinds of points; the rest of 1 is area-uniform.
struct LhsOptions {
  double walks = 0.9;              // random walks from camera poses
  double view = 0.0;               // primary hits of the first camera
  double stop_probability = 0.3;   // of a walk at each vertex
  int max_walk = 16;
  double keep_direction = 0.0;     // share of walk vertices that keep the direction they were reached by as wo
  bool uniform_glossy = false;     // fresh directions of glossy points: uniform over the hemisphere instead of cosine
  double glossy_boost = 1.0;       // >= 1: how much likelier a glossy point is taken than a rough one
  float rough_threshold = 0.5f;    // alpha from which a point counts as rough
  int poses = 0;                   // drawn once, with the sensors among them; 0: a fresh one for every walk. Not with `cameras`
  unsigned long long seed = 0;
};

inline constexpr int kLhsTries = 64;  // per point: a walk may leave the scene, an area sample may lie on a black back

// Where walks start: each from a pose of its own in free space, or from one of `poses`. The first pose is the scene's own view.
struct LhsPoses {
  const CameraView* poses = nullptr;
  std::uint32_t count = 0;
  bool fresh = false;
};

OCTRAD_HD inline Vec3f uniform_direction(Vec2f u) {
  const float z = 1.0f - 2.0f * u.x;
  const float r = std::sqrt(std::fmax(0.0f, 1.0f - z * z));
  return {r * std::cos(2.0f * kPi * u.y), r * std::sin(2.0f * kPi * u.y), z};
}

// Cosine-distributed direction around `n`.
OCTRAD_HD inline Vec3f cosine_direction(Vec3f n, Vec2f u) {
  const Vec3f v = n + uniform_direction(u) * 0.9999f;  // a unit sphere tangent at the point, seen from it: cosine density
  return normalize(v);
}

// Through a uniform pixel of the camera's own film.
OCTRAD_HD inline Ray random_ray(const CameraView& camera, Rng& rng) {
  const Vec2f u = rng.uniform2();
  return camera_ray(camera, {u.x * static_cast<float>(camera.width), u.y * static_cast<float>(camera.height)});
}

// A ray from a point of the free space that the camera can reach (part of the way along a short random walk from it; nothing
// inside closed objects can be reached so) in a uniform direction.
OCTRAD_HD_OR_HOST
template <typename World>
OCTRAD_HD inline bool free_ray(const World& world, const CameraView& camera, Rng& rng, Ray& ray) {
  Ray walk = random_ray(camera, rng);
  const int segments = 1 + static_cast<int>(rng.below(3));
  for (int s = 0; s < segments; ++s) {
    const Hit hit = world.intersect(walk.origin, walk.direction, 0.0f, kRayInfinity);
    if (!hit.valid()) return s > 0;
    ray.origin = walk.origin + walk.direction * (hit.t * (0.02f + 0.96f * rng.uniform()));
    ray.direction = uniform_direction(rng.uniform2());
    const SurfaceInteraction surface = world.interact(hit, walk.origin, walk.direction);
    const Vec3f n = dot(surface.geometric_normal, walk.direction) > 0.0f ? -surface.geometric_normal : surface.geometric_normal;
    walk.origin = offset_origin(surface.position, surface.geometric_normal, n);
    walk.direction = cosine_direction(n, rng.uniform2());
  }
  return true;
}

// Shades the surface as seen from a random direction on the side of `n`; false where that side is black. A cosine density
// hardly ever looks along a surface, but pictures of glossy floors and walls do: hence the uniform alternative.
OCTRAD_HD_OR_HOST
template <typename World>
OCTRAD_HD inline bool fresh_direction(const World& world, const LhsOptions& options, Rng& rng, const SurfaceInteraction& surface, Vec3f n, ShadingPoint& point) {
  const Vec2f u = rng.uniform2();
  point = world.shade(surface, cosine_direction(n, u));
  if (options.uniform_glossy && !point.black && roughness_bsdf(point.bsdf) < options.rough_threshold) {
    const Vec3f wo = uniform_direction(u);
    point = world.shade(surface, dot(wo, n) < 0.0f ? -wo : wo);
  }
  point.bsdf.opacity = 1.0f;
  return !point.black;
}

// A vertex of a random walk.
OCTRAD_HD_OR_HOST
template <typename World>
OCTRAD_HD inline bool walk_point(const World& world, const LhsOptions& options, const LhsPoses& poses, Rng& rng, ShadingPoint& point) {
  Ray ray;
  if (poses.fresh) {
    if (!free_ray(world, poses.poses[0], rng, ray)) return false;
  } else {
    ray = random_ray(poses.poses[rng.below(poses.count)], rng);
  }
  RayEnd end = follow_ray(world, ray.origin, nullptr, ray.direction, rng, false, options.max_walk);
  for (int vertex = 0; vertex < options.max_walk && end.surface; ++vertex) {
    if (rng.uniform() < options.stop_probability) {
      point = end.point;
      if (rng.uniform() < options.keep_direction) return true;
      const Vec3f n = viewed_normal(point);
      return fresh_direction(world, options, rng, end.point.surface, n, point);
    }
    const float u_lobe = rng.uniform();
    const BsdfSample scattered = sample_bsdf(end.point.bsdf, end.point.to_local(end.point.wo), u_lobe, rng.uniform2());
    if (!scattered.valid) return false;
    const Vec3f direction = normalize(end.point.to_world(scattered.wi));
    const Vec3f position = end.point.surface.position, normal = end.point.surface.geometric_normal;
    end = follow_ray(world, position, &normal, direction, rng, false, options.max_walk);
  }
  return false;
}

// What the first camera sees.
OCTRAD_HD_OR_HOST
template <typename World>
OCTRAD_HD inline bool view_point(const World& world, const LhsOptions& options, const LhsPoses& poses, Rng& rng, ShadingPoint& point) {
  const Ray ray = random_ray(poses.poses[0], rng);
  const RayEnd end = follow_ray(world, ray.origin, nullptr, ray.direction, rng, false, options.max_walk);
  point = end.point;
  return end.surface;
}

OCTRAD_HD_OR_HOST
template <typename World>
OCTRAD_HD inline bool area_point(const World& world, const LhsOptions& options, Rng& rng, ShadingPoint& point) {
  const float u_pick = rng.uniform();
  const SurfaceInteraction surface = world.sample_surface(u_pick, rng.uniform2());
  const float side = rng.uniform() < 0.5f ? -1.0f : 1.0f;  // one-sided backs turn out black and are drawn again
  return fresh_direction(world, options, rng, surface, surface.geometric_normal * side, point);
}

// Point `i` of step `step`. False where none was found in kLhsTries tries.
OCTRAD_HD_OR_HOST
template <typename World>
OCTRAD_HD inline bool lhs_point(const World& world, const LhsOptions& options, const LhsPoses& poses, unsigned long long step, unsigned long long i,
                                ShadingPoint& point) {
  Rng rng(options.seed, RngPurpose::walk, mix64(step + 1) ^ i);
  const double kind = rng.uniform();
  bool found = false;
  for (int t = 0; t < kLhsTries && !found; ++t) {
    if (kind < options.view) found = view_point(world, options, poses, rng, point);
    else if (kind < options.view + options.walks && t < kLhsTries / 2) found = walk_point(world, options, poses, rng, point);
    else found = area_point(world, options, rng, point);
    // What a glossy surface shows also depends on the direction: it needs more points than a rough one of its size.
    if (found && options.glossy_boost > 1.0 && t < kLhsTries / 2 && roughness_bsdf(point.bsdf) >= options.rough_threshold) {
      found = rng.uniform() * options.glossy_boost < 1.0;
    }
  }
  return found;
}

}  // namespace octrad
