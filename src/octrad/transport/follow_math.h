// Where rays end, for host and device: `World` casts rays, shades hits and samples lights (TransportContext,
// DeviceWorld).
#pragma once

#include "octrad/base/lookup_rule.h"
#include "octrad/base/query_rays.h"
#include "octrad/base/reflected_surface.h"
#include "octrad/base/rng.h"
#include "octrad/base/surface_point.h"
#include "octrad/geometry/hit.h"
#include "octrad/geometry/offset_math.h"
#include "octrad/shading/bsdf_math.h"
#include "octrad/shading/shading_point.h"
#include "octrad/transport/emitter_sample_math.h"

namespace octrad {

inline constexpr float kRayInfinity = 1e30f;

// The normal on the side of the viewer.
OCTRAD_HD inline Vec3f viewed_normal(const ShadingPoint& point) {
  return dot(point.ns, point.wo) < 0.0f ? -point.ns : point.ns;
}

// The point as a query of a radiance field: normal on the side of the viewer (method section 1).
template <Models kModels = Models::all>
OCTRAD_HD inline SurfacePoint surface_point(const ShadingPoint& shading) {
  SurfacePoint point;
  point.x = shading.surface.position;
  point.n = viewed_normal(shading);
  point.wo = shading.wo;
  const Vec3f wo = shading.to_local(shading.wo);
  point.albedo = lobe_albedo<kModels>(shading.bsdf, wo);
  point.alpha = roughness_bsdf<kModels>(shading.bsdf);
  // Where what is seen lies behind the surface, mirror directions must lead there (method section 1).
  if constexpr (kModels != Models::plain) {
    if (shading.bsdf.both_sides) {
      const SeenThrough behind = seen_through<kModels>(shading.bsdf, wo);
      if (behind.mainly) point.wo = reflect(normalize(shading.to_world(behind.direction)), point.n);
    }
  }
  return point;
}

// Attributes of the first surface seen (method section 1); where a mask lets the ray pass, of the one behind it.
struct FirstHit {
  bool valid = false;  // false: the ray met nothing; the rest keeps these values
  Vec3f albedo{0, 0, 0};
  Vec3f normal{0, 0, 0};  // shading normal, on the side of the viewer
  float depth = 0.0f;     // distance along the ray
  float roughness = 1.0f;
};

// A surface that the ray does not pass as a mask, `depth` from the ray's start.
template <Models kModels>
OCTRAD_HD inline FirstHit first_hit_of(const ShadingPoint& point, float depth) {
  return {true, point.black ? Vec3f(0.0f) : albedo_bsdf<kModels>(point.bsdf), viewed_normal(point), depth,
          roughness_bsdf<kModels>(point.bsdf)};
}

// Where a ray ends after masks have been passed through by chance (their opacity) and, if asked for, after mirrors and
// glass have been followed.
struct RayEnd {
  bool surface = false;           // ended on a surface that scatters; otherwise it left the scene or was absorbed
  ShadingPoint point;             // the surface, opacity already decided
  Vec3f throughput{1, 1, 1};      // of the delta surfaces passed
  Vec3f emitted{0, 0, 0};         // emission met after the first segment, times throughput
  Vec3f first_emitted{0, 0, 0};   // emission met at the end of the first segment (surface or environment)
  Vec3f passed_emitted{0, 0, 0};  // the part of both that was met before `point`, times throughput
  // Radiance that `point` itself emits along the ray; throughput times this is the other part.
  Vec3f own_emitted{0, 0, 0};
  float first_light_pdf = 0.0f;  // density with which light sampling from the ray's start finds it
  int rays = 0;
};

// One segment of a ray that passes surfaces.
struct Segment {
  Vec3f origin, direction;
  float t_max = kRayInfinity;
  int passed = 0;   // surfaces passed before
  int mirrors = 0;  // of these, what is followed: not masks
  // Where lights were sampled at the start of the segment, a near mirror: that point, and the density with which the
  // direction was drawn there. 0: emission that the segment meets was found by nothing else. Lights are sampled also
  // where no direction could be drawn; RayEnd::throughput is 0 then, and nothing is traced.
  Vec3f vertex{0, 0, 0};
  float pdf = 0.0f;
};

// The first segment of a ray that leaves `position`: a surface with `geometric_normal`, or free space where that is
// null.
OCTRAD_HD inline Segment first_segment(Vec3f position, const Vec3f* geometric_normal, Vec3f direction,
                                       float t_max = kRayInfinity) {
  Segment segment;
  segment.origin = geometric_normal ? offset_origin(position, *geometric_normal, direction) : position;
  segment.direction = direction;
  segment.t_max = t_max;
  return segment;
}

// Whether the ray that `point` was seen along passes through it, a mask: straight on, with the opacity as the
// probability of not doing so; the weight is 1 then, and otherwise the point is opaque.
OCTRAD_HD inline bool passes_mask(ShadingPoint& point, Rng& rng) {
  if (point.bsdf.opacity >= 1.0f) return false;
  const bool passes = rng.uniform() >= point.bsdf.opacity;
  if (!passes) point.bsdf.opacity = 1.0f;
  return passes;
}

// Sends the ray on from `end.point`, which it passes like a mirror, as the new `segment`; RayEnd::throughput takes the
// weight. False where nothing goes on. The caller sets where the segment starts (leave_surface).
template <Models kModels>
OCTRAD_HD inline bool pass_mirror(Rng& rng, Segment& segment, RayEnd& end) {
  ++segment.mirrors;
  const ShadingPoint& point = end.point;
  const float u_lobe = rng.stratified();
  const BsdfSample scattered = sample_bsdf<kModels>(point.bsdf, point.to_local(point.wo), u_lobe, rng.stratified2());
  const bool delta = scattered.valid ? scattered.delta : is_delta_bsdf(point.bsdf);
  end.throughput = scattered.valid ? end.throughput * scattered.weight : Vec3f(0.0f);
  if (delta && max_component(end.throughput) <= 0.0f) return false;
  segment.direction = scattered.valid ? normalize(point.to_world(scattered.wi)) : point.ns;
  segment.vertex = point.surface.position;
  segment.pdf = delta ? 0.0f : (scattered.valid ? scattered.pdf : 1.0f);
  return true;
}

OCTRAD_HD inline void leave_surface(const SurfaceInteraction& surface, Segment& segment) {
  segment.origin = offset_origin(surface.position, surface.geometric_normal, segment.direction);
  segment.t_max = kRayInfinity;
  ++segment.passed;
}

// Handles the hit of a segment of the ray that started at `position`. True where the ray goes on, as the new `segment`;
// else `end` is complete. `first`, if given, becomes the first surface that no mask let the ray pass, also where the
// ray goes on (a mirror) or is absorbed.
OCTRAD_HD_OR_HOST
template <typename World>
OCTRAD_HD inline bool follow_hit(const World& world, Vec3f position, const Hit& hit, Rng& rng, float follow_below,
                                 Segment& segment, RayEnd& end, FirstHit* first) {
  const bool start = segment.passed == 0;  // only here could light sampling from `position` have found the same emitter
  const Vec3f direction = segment.direction;
  ++end.rays;
  if (!hit.valid()) {
    const Vec3f radiance = world.environment(direction);
    if (start) {
      end.first_emitted = radiance;
      end.first_light_pdf = world.environment_pdf(position, direction);
    } else {
      const float mis =
          segment.pdf > 0.0f ? segment.pdf / (segment.pdf + world.environment_pdf(segment.vertex, direction)) : 1.0f;
      end.emitted += end.throughput * radiance * mis;
    }
    return false;
  }
  const SurfaceInteraction surface = world.interact(hit, segment.origin, direction);
  end.passed_emitted = end.first_emitted + end.emitted;
  end.own_emitted = Vec3f(0.0f);
  if (surface.emitter >= 0) {
    const Vec3f radiance = world.emitted(surface, -direction);
    end.own_emitted = radiance;
    if (start) {
      end.first_emitted = radiance;
      end.first_light_pdf = world.light_pdf(position, surface);
    } else {
      const float mis =
          segment.pdf > 0.0f ? segment.pdf / (segment.pdf + world.light_pdf(segment.vertex, surface)) : 1.0f;
      end.emitted += end.throughput * radiance * mis;
    }
  }
  end.point = world.shade(surface, -direction);
  const bool passes = passes_mask(end.point, rng);
  if (first && !passes && !first->valid)
    *first = first_hit_of<World::kModels>(end.point, length(surface.position - position));
  if (!passes) {
    if (end.point.black) return false;
    if (!is_followed<World::kModels>(end.point.bsdf, follow_below)) {
      end.surface = true;
      return false;
    }
    if (!pass_mirror<World::kModels>(rng, segment, end)) return false;
  } else {
    segment.pdf = 0.0f;  // shadow rays of emitters that rays meet do not pass masks
  }
  leave_surface(surface, segment);
  return true;
}

// Whether there is a new segment to trace after follow_hit() was true.
OCTRAD_HD inline bool goes_on(const Segment& segment, const RayEnd& end, int max_chain) {
  if (max_component(end.throughput) <= 0.0f) return false;
  // What is left of a longer chain is lost (method section 7).
  return segment.mirrors <= max_chain && segment.passed <= max_chain + kMostMasks;
}

// After a mirror: adds the light that it gets straight from an emitter, times the throughput up to it.
OCTRAD_HD_OR_HOST
template <typename World>
OCTRAD_HD inline void add_light_at_mirror(const World& world, const Segment& segment, Vec3f throughput, Rng& rng,
                                          RayEnd& end) {
  if (!(segment.pdf > 0.0f)) return;
  const Vec2f u = rng.stratified2();
  const EmitterSample light =
      sample_emitter(world, end.point, end.point.to_local(end.point.wo), SobolSet::Sample{u, rng.stratified()});
  if (!light.valid) return;
  ++end.rays;
  if (!world.occluded(light.ray.origin, light.ray.direction, 0.0f, light.ray.t_max))
    end.emitted += throughput * light.contribution;
}

// The rest of the ray, where the hit of the current segment is known already. `segment` and `hit` become the last ones.
OCTRAD_HD_OR_HOST
template <typename World>
OCTRAD_HD inline void follow_from(const World& world, Vec3f position, Hit& hit, Rng& rng, float follow_below,
                                  int max_chain, Segment& segment, RayEnd& end, FirstHit* first = nullptr) {
  for (;;) {
    const Vec3f throughput = end.throughput;  // up to the surface
    if (!follow_hit(world, position, hit, rng, follow_below, segment, end, first)) return;
    add_light_at_mirror(world, segment, throughput, rng, end);
    if (!goes_on(segment, end, max_chain)) return;
    hit = world.intersect(segment.origin, segment.direction, 0.0f, segment.t_max);
  }
}

// Follows a ray to its end, over at most `max_chain` mirrors and the like.
OCTRAD_HD_OR_HOST
template <typename World>
OCTRAD_HD inline RayEnd follow_ray(const World& world, Vec3f position, const Vec3f* geometric_normal, Vec3f direction,
                                   Rng& rng, float follow_below, int max_chain, float t_max = kRayInfinity,
                                   FirstHit* first = nullptr) {
  RayEnd end;
  if (max_chain < 0) return end;
  Segment segment = first_segment(position, geometric_normal, direction, t_max);
  Hit hit = world.intersect(segment.origin, segment.direction, 0.0f, segment.t_max);
  follow_from(world, position, hit, rng, follow_below, max_chain, segment, end, first);
  return end;
}

// Follows a glossy lobe of a surface like a near mirror: of a coated one `point` is restricted to its coat
// (Lobe::coat). `segment` and `hit` become the last ones.
OCTRAD_HD_OR_HOST
template <typename World>
OCTRAD_HD inline RayEnd follow_lobe(const World& world, const ShadingPoint& point, Rng& rng, float follow_below,
                                    int max_chain, Segment& segment, Hit& hit) {
  RayEnd end;
  end.point = point;
  segment = Segment{};
  if (!pass_mirror<World::kModels>(rng, segment, end)) return end;
  leave_surface(point.surface, segment);
  add_light_at_mirror(world, segment, Vec3f(1.0f), rng, end);
  if (!goes_on(segment, end, max_chain)) return end;
  hit = world.intersect(segment.origin, segment.direction, 0.0f, segment.t_max);
  follow_from(world, point.surface.position, hit, rng, follow_below, max_chain, segment, end);
  return end;
}

// What the ray shows that met `hit`.
OCTRAD_HD_OR_HOST
template <typename World>
OCTRAD_HD inline ReflectedSurface reflected_surface(const World& world, const Hit& hit, Vec3f origin, Vec3f direction) {
  ReflectedSurface reflected;
  if (!hit.valid()) {
    reflected.emitted = world.environment(direction);
    return reflected;
  }
  const SurfaceInteraction surface = world.interact(hit, origin, direction);
  if (surface.emitter >= 0) reflected.emitted = world.emitted(surface, -direction);
  ShadingPoint shading = world.shade(surface, -direction);
  if (is_coated(shading.bsdf)) shading.bsdf.lobe = Lobe::base;
  reflected.met = 1.0f;
  reflected.alpha = is_coated(shading.bsdf) ? 1.0f : roughness_bsdf<World::kModels>(shading.bsdf);
  reflected.n = viewed_normal(shading);
  if (!shading.black) reflected.albedo = lobe_albedo<World::kModels>(shading.bsdf, shading.to_local(shading.wo));
  return reflected;
}

// Whether the ray of `offset` from a point has a direction of its own: on glossy points whose mirror direction is that
// of what they reflect. Refraction turns rays less than reflection does, so points that are seen through have none.
OCTRAD_HD inline bool draws_offset_direction(const OffsetRay& offset, const SurfacePoint& point) {
  return offset.traced && offset.reflected && offset.spread > 0.0f && offset.rule.has_offset(point.alpha) &&
         point.alpha < offset.rule.rough_threshold && dot(point.wo, point.n) > 0.0f;
}

// That direction: where the look-up would lead if the normal were n + t, with t drawn evenly in a disc of radius
// spread x roughness across n (method section 4); n - t where that would lead into the surface with `geometric_normal`
// (towards the viewer or away), and 0, the look-up direction itself, where both would. Draws nothing and is 0 where
// draws_offset_direction() is false.
OCTRAD_HD inline Vec3f draw_offset_direction(const OffsetRay& offset, const SurfacePoint& point, Vec3f geometric_normal,
                                             Rng& rng) {
  if (!draws_offset_direction(offset, point)) return Vec3f(0.0f);
  const Vec2f u = rng.stratified2();
  const Vec2f tangent = circle_point(u.y) * (offset.spread * point.alpha * std::sqrt(u.x));
  const Vec3f t = make_frame(point.n).to_world({tangent.x, tangent.y, 0.0f});
  const float side = dot(point.wo, geometric_normal);
  for (int turn = 0; turn < 2; ++turn) {
    SurfacePoint tilted = point;
    tilted.n = normalize(turn == 0 ? point.n + t : point.n - t);
    const Vec3f direction = lookup_direction(offset.rule, tilted);
    if (dot(direction, point.n) > 0.0f && dot(direction, geometric_normal) * side > 0.0f) return normalize(direction);
  }
  return Vec3f(0.0f);
}

// The ray of `offset` from a point of a surface with `geometric_normal`, along `drawn` or, where that is 0, the look-up
// direction: fills SurfacePoint::disparity (1 / distance to the next surface; 0 where the ray leaves the scene) and, if
// asked for, SurfacePoint::reflected. Nothing where the look-up has no offset.
OCTRAD_HD_OR_HOST
template <typename World>
OCTRAD_HD inline void trace_offset(const World& world, const OffsetRay& offset, Vec3f geometric_normal,
                                   SurfacePoint& point, Vec3f drawn = Vec3f(0.0f)) {
  if (!offset.traced || !offset.rule.has_offset(point.alpha)) return;
  const Vec3f direction = dot(drawn, drawn) > 0.0f ? drawn : lookup_direction(offset.rule, point);
  const Vec3f origin = offset_origin(point.x, geometric_normal, direction);
  const Hit hit = world.intersect(origin, direction, 0.0f, kRayInfinity);
  point.disparity = hit.valid() && hit.t > 0.0f ? 1.0f / hit.t : 0.0f;
  if (!offset.reflected) return;
  point.reflected = reflected_surface(world, hit, origin, direction);
  point.reflected.w = drawn;
}

}  // namespace octrad
