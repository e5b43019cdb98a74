// One left-hand-side point (transport/lhs_sampler.h), for host and device.
#pragma once

#include <cmath>

#include "octrad/scene/camera_math.h"
#include "octrad/transport/follow_math.h"

namespace octrad {

// Shares of the three kinds of points; the rest of 1 is area-uniform.
struct LhsOptions {
  double walks = 0.9;             // random walks from camera poses
  double view = 0.0;              // primary hits of the first camera
  double stop_probability = 0.3;  // of a walk at each vertex
  int max_walk = 16;
  double keep_direction = 0.0;   // share of walk vertices that keep the direction they were reached by as wo
  bool uniform_glossy = false;   // fresh directions of glossy points: uniform over the hemisphere instead of cosine
  double glossy_boost = 1.0;     // >= 1: how much likelier a glossy point is taken than a rough one
  float rough_threshold = 0.5f;  // alpha from which a point counts as rough
  int poses = 0;  // drawn once, with the sensors among them; 0: a fresh one for every walk. Not with `cameras`
  unsigned long long seed = 0;
};

inline constexpr std::uint32_t kLhsTries =
    64;  // per point: a walk may leave the scene, an area sample may lie on a black back

// Where walks start: each from a pose of its own in free space, or from one of `poses`. The first pose is the scene's
// own view.
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
  return camera_ray(camera, {u.x * static_cast<float>(camera.width), u.y * static_cast<float>(camera.height)});
}

// A way through the free space: a short random walk from a camera, on one leg of which a free ray starts.
struct FreeWay {
  Vec3f origin, direction;  // of the leg
  Vec3f free_origin, free_direction;
};

// A leg has ended on a surface: a free ray from part of the way along it in a uniform direction, and the next leg
// unless this was the `last`.
OCTRAD_HD inline void free_leg(const SurfaceInteraction& surface, float t, bool last, Rng& rng, FreeWay& way) {
  way.free_origin = way.origin + way.direction * (t * (0.02f + 0.96f * rng.uniform()));
  way.free_direction = uniform_direction(rng.uniform2());
  const Vec2f u = rng.uniform2();
  if (last) return;
  const Vec3f n =
      dot(surface.geometric_normal, way.direction) > 0.0f ? -surface.geometric_normal : surface.geometric_normal;
  way.origin = offset_origin(surface.position, surface.geometric_normal, n);
  way.direction = cosine_direction(n, u);
}

OCTRAD_HD inline std::uint32_t free_legs(Rng& rng) { return 1 + rng.below(3); }

// A ray from a point of the free space that the camera can reach (nothing inside closed objects can be reached so).
OCTRAD_HD_OR_HOST
template <typename World>
OCTRAD_HD inline bool free_ray(const World& world, const CameraView& camera, Rng& rng, Ray& ray) {
  const Ray first = random_ray(camera, rng);
  FreeWay way{first.origin, first.direction, {}, {}};
  const std::uint32_t legs = free_legs(rng);
  for (std::uint32_t leg = 0; leg < legs; ++leg) {
    const Hit hit = world.intersect(way.origin, way.direction, 0.0f, kRayInfinity);
    if (!hit.valid()) return leg > 0;
    free_leg(world.interact(hit, way.origin, way.direction), hit.t, leg + 1 == legs, rng, way);
    ray.origin = way.free_origin;
    ray.direction = way.free_direction;
  }
  return true;
}

// What a point that is being drawn needs next.
enum class LhsNext { ray, no_ray, found, missing };

// What it is after: a free ray to walk from, a vertex of the walk, what the first camera sees, any surface.
enum class LhsAim : std::uint32_t { free_ray, walk, view, area };

// A point that is being drawn, between two rays, so that many can be drawn side by side: lhs_try() begins, lhs_arrive()
// goes on.
struct LhsDraw {
  Rng rng;
  FreeWay way;  // origin and direction are those of the ray to trace, whatever the aim
  LhsAim aim = LhsAim::area;
  std::uint32_t tries = 0;
  std::uint32_t vertex = 0;  // of the walk, or leg of the free way
  std::uint32_t legs = 0;    // of the free way
  std::uint32_t passed = 0;  // masks since the last vertex

  // Point `i` of step `step`.
  OCTRAD_HD LhsDraw(const LhsOptions& options, unsigned long long step, unsigned long long i)
      : rng(options.seed, RngPurpose::walk, mix64(step + 1) ^ i) {
    const double kind = rng.uniform();
    if (kind < options.view) aim = LhsAim::view;
    else if (kind < options.view + options.walks) aim = LhsAim::walk;
  }
  OCTRAD_HD explicit LhsDraw(const Rng& generator) : rng(generator) {}
};

// A new try.
OCTRAD_HD inline LhsNext lhs_try(const LhsPoses& poses, LhsDraw& draw) {
  const bool view = draw.aim == LhsAim::view;
  if (draw.aim == LhsAim::area || (!view && draw.tries >= kLhsTries / 2)) {
    draw.aim = LhsAim::area;
    return LhsNext::no_ray;
  }
  const Ray ray = random_ray(poses.poses[view || poses.fresh ? 0 : draw.rng.below(poses.count)], draw.rng);
  draw.way.origin = ray.origin;
  draw.way.direction = ray.direction;
  if (!view) draw.aim = poses.fresh ? LhsAim::free_ray : LhsAim::walk;
  if (!view && poses.fresh) draw.legs = free_legs(draw.rng);
  draw.vertex = draw.passed = 0;
  return LhsNext::ray;
}

// The rest of what lhs_arrive() does where it has come to a surface, on a walk, from the first camera or by chance.
OCTRAD_HD_OR_HOST
template <typename World>
OCTRAD_HD inline LhsNext lhs_look(const World& world, const LhsOptions& options, const SurfaceInteraction& surface,
                                  LhsDraw& draw, ShadingPoint& point) {
  const auto longest = static_cast<std::uint32_t>(options.max_walk);
  FreeWay& way = draw.way;
  Vec3f wo = -way.direction;
  Vec3f n;  // the side to look at from a fresh direction
  Vec2f u;
  // What shading is for: the end of the ray, a point seen from a fresh direction, the same from one that suits glossy
  // points.
  enum { end, fresh, glossy } look = end;
  if (draw.aim == LhsAim::area) {
    const float side = draw.rng.uniform() < 0.5f ? -1.0f : 1.0f;  // one-sided backs turn out black and are drawn again
    n = surface.geometric_normal * side;
    look = fresh;
  }
  for (;;) {  // a loop, so that kernels hold shading once
    if (look == fresh) {
      u = draw.rng.uniform2();
      wo = cosine_direction(n, u);
    }
    point = world.shade(surface, wo);
    if (look != end) {
      point.bsdf.opacity = 1.0f;
      if (point.black) return LhsNext::missing;
      if (look == glossy || !options.uniform_glossy || roughness_bsdf(point.bsdf) >= options.rough_threshold)
        return LhsNext::found;
      // A cosine density hardly ever looks along a surface, but pictures of glossy floors and walls do.
      wo = uniform_direction(u);
      if (dot(wo, n) < 0.0f) wo = -wo;
      look = glossy;
      continue;
    }
    if (passes_mask(point, draw.rng)) {
      way.origin = offset_origin(surface.position, surface.geometric_normal, way.direction);
      return ++draw.passed <= longest ? LhsNext::ray : LhsNext::missing;
    }
    if (point.black) return LhsNext::missing;
    if (draw.aim == LhsAim::view) return LhsNext::found;
    if (draw.vertex >= longest) return LhsNext::missing;
    if (draw.rng.uniform() < options.stop_probability) {
      if (draw.rng.uniform() < options.keep_direction) return LhsNext::found;
      n = viewed_normal(point);
      look = fresh;
      continue;
    }
    const float u_lobe = draw.rng.uniform();
    const BsdfSample scattered = sample_bsdf(point.bsdf, point.to_local(point.wo), u_lobe, draw.rng.uniform2());
    if (!scattered.valid) return LhsNext::missing;
    way.direction = normalize(point.to_world(scattered.wi));
    way.origin = offset_origin(surface.position, surface.geometric_normal, way.direction);
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

// Goes on where lhs_try() or lhs_arrive() answered `ray`, with what that ray hit, or `no_ray`. `point` is of use where
// the answer is `found`. `missing`: there was nothing in kLhsTries tries.
OCTRAD_HD_OR_HOST
template <typename World>
OCTRAD_HD inline LhsNext lhs_arrive(const World& world, const LhsOptions& options, const LhsPoses& poses,
                                    const Hit& hit, LhsDraw& draw, ShadingPoint& point) {
  FreeWay& way = draw.way;
  const bool area = draw.aim == LhsAim::area, leg = draw.aim == LhsAim::free_ray;
  LhsNext next = LhsNext::missing;
  if (area || hit.valid()) {
    const SurfaceInteraction surface =
        area ? area_surface(world, draw.rng) : world.interact(hit, way.origin, way.direction);
    if (leg) free_leg(surface, hit.t, ++draw.vertex == draw.legs, draw.rng, way);
    else next = lhs_look(world, options, surface, draw, point);
  }
  if (leg && draw.vertex > 0) {
    next = LhsNext::ray;
    if (!hit.valid() || draw.vertex == draw.legs) {
      way.origin = way.free_origin;  // the way ends after its last leg, or where it leaves the scene
      way.direction = way.free_direction;
      draw.aim = LhsAim::walk;
      draw.vertex = 0;
    }
  }
  if (next == LhsNext::ray) return next;
  // What a glossy surface shows also depends on the direction: it needs more points than a rough one of its size.
  if (next == LhsNext::found && options.glossy_boost > 1.0 && draw.tries < kLhsTries / 2 &&
      roughness_bsdf(point.bsdf) >= options.rough_threshold && !(draw.rng.uniform() * options.glossy_boost < 1.0)) {
    next = LhsNext::missing;
  }
  return next == LhsNext::missing && ++draw.tries < kLhsTries ? lhs_try(poses, draw) : next;
}

// Draws on to the end: true where that is a point.
OCTRAD_HD_OR_HOST
template <typename World>
OCTRAD_HD inline bool lhs_finish(const World& world, const LhsOptions& options, const LhsPoses& poses, LhsNext next,
                                 LhsDraw& draw, ShadingPoint& point) {
  while (next == LhsNext::ray || next == LhsNext::no_ray) {
    Hit hit;
    if (next == LhsNext::ray) hit = world.intersect(draw.way.origin, draw.way.direction, 0.0f, kRayInfinity);
    next = lhs_arrive(world, options, poses, hit, draw, point);
  }
  return next == LhsNext::found;
}

// Point `i` of step `step`. False where none was found in kLhsTries tries.
OCTRAD_HD_OR_HOST
template <typename World>
OCTRAD_HD inline bool lhs_point(const World& world, const LhsOptions& options, const LhsPoses& poses,
                                unsigned long long step, unsigned long long i, ShadingPoint& point) {
  LhsDraw draw(options, step, i);
  const LhsNext next = lhs_try(poses, draw);
  return lhs_finish(world, options, poses, next, draw, point);
}

}  // namespace octrad
