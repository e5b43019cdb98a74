// One left-hand-side point (transport/lhs_sampler.h), for host and device.
#pragma once

#include <cmath>

#include "octrad/scene/camera_math.h"
#include "octrad/transport/camera_hit_math.h"
#include "octrad/transport/follow_math.h"

namespace octrad {

// Shares of the three kinds of points; the rest of 1 is area-uniform.
struct LhsOptions {
  double walks = 0.9;             // random walks from camera poses
  double view = 0.0;              // primary hits of the first camera
  double stop_probability = 0.3;  // of a walk at each vertex, divided by glossy_boost on rough surfaces
  int max_walk = 16;
  double keep_direction = 0.0;   // share of walk vertices that keep the direction they were reached by as wo
  bool uniform_glossy = false;   // fresh directions of glossy points: uniform over the hemisphere instead of cosine
  double glossy_boost = 1.0;     // >= 1: how much likelier a glossy point is taken than a rough one
  float rough_threshold = 0.5f;  // alpha from which a point counts as rough
  float follow_below = 0.0f;     // of is_followed(): surfaces that nobody asks about; walks go on there
  bool split_coats = false;      // points of coated surfaces are of one of their lobes
  // Drawn once, with the sensors among them; 0: a fresh one for every walk. Not with `cameras`.
  int poses = 0;
  unsigned long long seed = 0;
};

// Tries per point: a walk may leave the scene, an area sample may lie on a black back.
inline constexpr std::uint32_t kLhsTries = 64;

// Where walks start: each from one of `poses`, or, if `fresh`, from a pose of its own in the free space that one of
// them sees. The first is the scene's own view.
struct LhsPoses {
  const CameraView* poses = nullptr;
  std::uint32_t count = 0;
  bool fresh = false;
};

// Cosine-distributed direction around `n`.
OCTRAD_HD inline Vec3f cosine_direction(Vec3f n, Vec2f u) {
  const Vec3f v =
      n + uniform_direction(u) * 0.9999f;  // a unit sphere tangent at the point, seen from it: cosine density
  return normalize(v);
}

// Through a uniform pixel of the camera's own film.
OCTRAD_HD inline Ray random_ray(const CameraView& camera, Rng& rng) {
  const Vec2f u = rng.uniform2();
  return sample_camera_ray(camera, {u.x * static_cast<float>(camera.width), u.y * static_cast<float>(camera.height)},
                           rng);
}

// A short random walk through free space from a camera; a pose (origin and direction of a ray) lies on its last leg.
struct PoseWalk {
  Vec3f origin, direction;  // of the leg
  Vec3f pose_origin, pose_direction;
};

// A leg has ended on a surface: draws a pose at a random place on the leg, in a uniform direction, and the next leg
// unless this was the `last`.
OCTRAD_HD inline void extend_pose_walk(const SurfaceInteraction& surface, float t, bool last, Rng& rng,
                                       PoseWalk& walk) {
  walk.pose_origin = walk.origin + walk.direction * (t * (0.02f + 0.96f * rng.uniform()));
  walk.pose_direction = uniform_direction(rng.uniform2());
  const Vec2f u = rng.uniform2();
  if (last) return;
  const Vec3f n =
      dot(surface.geometric_normal, walk.direction) > 0.0f ? -surface.geometric_normal : surface.geometric_normal;
  walk.origin = offset_origin(surface.position, surface.geometric_normal, n);
  walk.direction = cosine_direction(n, u);
}

OCTRAD_HD inline std::uint32_t pose_walk_legs(Rng& rng) { return 1 + rng.below(3); }

// A ray from a point of the free space that the camera can reach (nothing inside closed objects can be reached so).
OCTRAD_HD_OR_HOST
template <typename World>
OCTRAD_HD inline bool pose_ray(const World& world, const CameraView& camera, Rng& rng, Ray& ray) {
  const Ray first = random_ray(camera, rng);
  PoseWalk walk{first.origin, first.direction, {}, {}};
  const std::uint32_t legs = pose_walk_legs(rng);
  for (std::uint32_t leg = 0; leg < legs; ++leg) {
    const Ray next{walk.origin, walk.direction, kRayInfinity};
    int rays = 0;
    const Hit hit =
        leg == 0 ? camera_hit(world, next, rays) : world.intersect(next.origin, next.direction, 0.0f, next.t_max);
    if (!hit.valid()) return leg > 0;
    extend_pose_walk(world.interact(hit, walk.origin, walk.direction), hit.t, leg + 1 == legs, rng, walk);
    ray.origin = walk.pose_origin;
    ray.direction = walk.pose_direction;
  }
  return true;
}

// Result of one step of drawing a point: a ray must be traced, or none is needed to go on; a point was found, or not.
enum class LhsNext { ray, no_ray, found, missing };

// What its rays are for: finding a pose, walking from a pose, the view of the first camera, or none (uniform by area).
enum class LhsKind : std::uint32_t { pose, walk, view, area };

// The state of drawing one point, between two rays, so that many points can be drawn as a wavefront: lhs_start_try(),
// then lhs_advance() until it is done.
struct LhsDraw {
  Rng rng;
  PoseWalk walk;  // origin and direction are those of the ray to trace, whatever the kind
  LhsKind kind = LhsKind::area;
  std::uint32_t tries = 0;
  std::uint32_t vertex = 0;  // of the walk, or leg of the pose walk
  std::uint32_t legs = 0;    // of the pose walk
  std::uint32_t passed = 0;  // masks since the last vertex

  // Point `i` of step `step`; `by_area`: as of LhsSampler::sample().
  OCTRAD_HD LhsDraw(const LhsOptions& options, unsigned long long step, unsigned long long i, double by_area)
      : rng(options.seed, RngPurpose::walk, mix64(step + 1) ^ i) {
    const double choice = rng.uniform();
    if (choice < options.view) kind = LhsKind::view;
    else if (choice < 1.0 - (1.0 - (options.view + options.walks)) * by_area) kind = LhsKind::walk;
  }
  OCTRAD_HD explicit LhsDraw(const Rng& generator) : rng(generator) {}
};

// Begins a try.
OCTRAD_HD inline LhsNext lhs_start_try(const LhsPoses& poses, LhsDraw& draw) {
  const bool view = draw.kind == LhsKind::view;
  if (draw.kind == LhsKind::area || draw.tries >= kLhsTries / 2) {
    draw.kind = LhsKind::area;
    return LhsNext::no_ray;
  }
  const Ray ray = random_ray(poses.poses[view || poses.count == 1 ? 0 : draw.rng.below(poses.count)], draw.rng);
  draw.walk.origin = ray.origin;
  draw.walk.direction = ray.direction;
  if (!view) draw.kind = poses.fresh ? LhsKind::pose : LhsKind::walk;
  if (!view && poses.fresh) draw.legs = pose_walk_legs(draw.rng);
  draw.vertex = draw.passed = 0;
  return LhsNext::ray;
}

// Shades the surface at the end of a ray or the one that was drawn by area, and decides what comes next; the second
// half of lhs_advance().
OCTRAD_HD_OR_HOST
template <typename World>
OCTRAD_HD inline LhsNext lhs_shade(const World& world, const LhsOptions& options, const SurfaceInteraction& surface,
                                   LhsDraw& draw, ShadingPoint& point) {
  const auto longest = static_cast<std::uint32_t>(options.max_walk);
  PoseWalk& walk = draw.walk;
  Vec3f wo = -walk.direction;
  Vec3f n;  // the side to look at from a fresh direction
  Vec2f u;
  // Direction that the surface is shaded from: along the ray, fresh, or fresh with the density for glossy points.
  enum { end, fresh, glossy } look = end;
  if (draw.kind == LhsKind::area) {
    const float side = draw.rng.uniform() < 0.5f ? -1.0f : 1.0f;  // one-sided backs turn out black and are drawn again
    n = surface.geometric_normal * side;
    look = fresh;
  }
  const auto passed = [&](const ShadingPoint& p) {
    return draw.tries < kLhsTries / 2 && is_followed<World::kModels>(p.bsdf, options.follow_below);
  };
  for (;;) {  // a loop, so that kernels contain the code of shading once
    if (look == fresh) {
      u = draw.rng.uniform2();
      wo = cosine_direction(n, u);
    }
    point = world.shade(surface, wo);
    if (look != end) {
      point.bsdf.opacity = 1.0f;
      if (point.black || point.bsdf.type == BsdfType::null) return LhsNext::missing;
      if (draw.kind == LhsKind::area && passed(point)) return LhsNext::missing;
      if (look == glossy || !options.uniform_glossy ||
          roughness_bsdf<World::kModels>(point.bsdf) >= options.rough_threshold)
        return LhsNext::found;
      // A cosine density hardly ever looks along a surface, but pictures of glossy floors and walls do.
      wo = uniform_direction(u);
      if (dot(wo, n) < 0.0f) wo = -wo;
      look = glossy;
      continue;
    }
    if (passes_mask(point, draw.rng)) {
      walk.origin = offset_origin(surface.position, surface.geometric_normal, walk.direction);
      return ++draw.passed <= longest ? LhsNext::ray : LhsNext::missing;
    }
    if (point.black) return LhsNext::missing;
    const bool follow = passed(point);
    if (draw.kind == LhsKind::view && !follow) return LhsNext::found;
    if (draw.vertex >= longest) return LhsNext::missing;
    // What a glossy surface shows also depends on the direction: it needs more points than a rough one of its size.
    const double reluctance =
        roughness_bsdf<World::kModels>(point.bsdf) < options.rough_threshold ? 1.0 : options.glossy_boost;
    if (!follow && draw.rng.uniform() * reluctance < options.stop_probability) {
      if (draw.rng.uniform() < options.keep_direction) return LhsNext::found;
      n = viewed_normal(point);
      look = fresh;
      continue;
    }
    const float u_lobe = draw.rng.uniform();
    const BsdfSample scattered =
        sample_bsdf<World::kModels>(point.bsdf, point.to_local(point.wo), u_lobe, draw.rng.uniform2());
    if (!scattered.valid) return LhsNext::missing;
    walk.direction = normalize(point.to_world(scattered.wi));
    walk.origin = offset_origin(surface.position, surface.geometric_normal, walk.direction);
    ++draw.vertex;
    draw.passed = 0;
    return LhsNext::ray;
  }
}

OCTRAD_HD_OR_HOST
template <typename World>
OCTRAD_HD inline SurfaceInteraction area_surface(const World& world, Rng& rng) {
  const float u_pick = rng.uniform();
  return world.sample_surface(u_pick, rng.uniform2());
}

// The next step after lhs_start_try() or lhs_advance() returned `ray` (`hit`: of that ray) or `no_ray`. `point` is set
// where the result is `found`. `missing`: kLhsTries tries have failed.
OCTRAD_HD_OR_HOST
template <typename World>
OCTRAD_HD inline LhsNext lhs_advance(const World& world, const LhsOptions& options, const LhsPoses& poses,
                                     const Hit& hit, LhsDraw& draw, ShadingPoint& point) {
  PoseWalk& walk = draw.walk;
  const bool area = draw.kind == LhsKind::area, leg = draw.kind == LhsKind::pose;
  LhsNext next = LhsNext::missing;
  if (area || hit.valid()) {
    const SurfaceInteraction surface =
        area ? area_surface(world, draw.rng) : world.interact(hit, walk.origin, walk.direction);
    if (!area && draw.vertex == 0 && surface.emitter >= 0 && world.hides_emitters()) {
      // What a camera would see behind it.
      walk.origin = offset_origin(surface.position, surface.geometric_normal, walk.direction);
      if (++draw.passed <= kMostHiddenEmitters) return LhsNext::ray;
    } else if (leg) extend_pose_walk(surface, hit.t, ++draw.vertex == draw.legs, draw.rng, walk);
    else next = lhs_shade(world, options, surface, draw, point);
  }
  if (leg && draw.vertex > 0) {
    next = LhsNext::ray;
    if (!hit.valid() || draw.vertex == draw.legs) {
      walk.origin = walk.pose_origin;  // the pose walk ends after its last leg, or where it leaves the scene
      walk.direction = walk.pose_direction;
      draw.kind = LhsKind::walk;
      draw.vertex = draw.passed = 0;
    }
  }
  if (next == LhsNext::ray) return next;
  if (area && next == LhsNext::found && options.glossy_boost > 1.0 && draw.tries < kLhsTries / 2 &&
      roughness_bsdf<World::kModels>(point.bsdf) >= options.rough_threshold &&
      !(draw.rng.uniform() * options.glossy_boost < 1.0)) {
    next = LhsNext::missing;
  }
  if (next == LhsNext::found && options.split_coats && has_lobes(point.bsdf))
    point.bsdf.lobe = draw.rng.uniform() < 0.5f ? Lobe::coat : Lobe::base;
  return next == LhsNext::missing && ++draw.tries < kLhsTries ? lhs_start_try(poses, draw) : next;
}

// All remaining steps. Whether a point was found.
OCTRAD_HD_OR_HOST
template <typename World>
OCTRAD_HD inline bool lhs_finish(const World& world, const LhsOptions& options, const LhsPoses& poses, LhsNext next,
                                 LhsDraw& draw, ShadingPoint& point) {
  while (next == LhsNext::ray || next == LhsNext::no_ray) {
    Hit hit;
    if (next == LhsNext::ray) hit = world.intersect(draw.walk.origin, draw.walk.direction, 0.0f, kRayInfinity);
    next = lhs_advance(world, options, poses, hit, draw, point);
  }
  return next == LhsNext::found;
}

// Point `i` of step `step`. False where none was found in kLhsTries tries.
OCTRAD_HD_OR_HOST
template <typename World>
OCTRAD_HD inline bool lhs_point(const World& world, const LhsOptions& options, const LhsPoses& poses,
                                unsigned long long step, unsigned long long i, double by_area, ShadingPoint& point) {
  LhsDraw draw(options, step, i, by_area);
  const LhsNext next = lhs_start_try(poses, draw);
  return lhs_finish(world, options, poses, next, draw, point);
}

}  // namespace octrad
