// What a camera sample asks of a radiance field (method section 8), for host and device. The path integrators, the
// G-buffer kernels and validation all decide it here.
#pragma once

#include "octrad/base/follow_rules.h"
#include "octrad/base/query_rays.h"
#include "octrad/scene/camera_math.h"
#include "octrad/transport/camera_hit_math.h"
#include "octrad/transport/follow_math.h"

namespace octrad {

struct FirstHitOptions : FollowRules {
  FirstHitOptions() = default;
  explicit FirstHitOptions(const FollowRules& rules) : FollowRules(rules) {}
  enum class Bounce { none, glossy, all } bounce = Bounce::none;  // which points are estimated by one bounce instead
  float rough_threshold = 0.5f;                                   // glossy: below
  bool bounce_delta = true;                                       // glossy: also perfect mirrors and glass
  float coat_samples = 0.0f, metal_samples = 0.0f;                // of follows_lobe()
};

// Whether sample `number` of a pixel follows the glossy lobe of a surface like a near mirror, instead of asking the
// field for it: of a coated surface the coat, of another all of it. coat_samples (metal_samples) x alpha^2 samples have
// asked then, whose mean has less noise. Their share falls with the number of samples, and with it what the field blurs
// (render.coat_samples and render.metal_samples, method section 8). Blends have rough lobes too, and light crosses hair
// many times: both are asked for always.
template <Models kModels = Models::all>
OCTRAD_HD inline bool follows_lobe(const FirstHitOptions& options, const Bsdf& bsdf, int number) {
  const float samples = is_coated(bsdf) ? options.coat_samples : options.metal_samples;
  if (!options.split_coats || !(samples > 0.0f && options.follow_below > 0.0f)) return false;
  if (bsdf.type == BsdfType::blendbsdf || bsdf.type == BsdfType::hair) return false;
  const float alpha = roughness_bsdf<kModels>(bsdf);
  return alpha < 1.0f && static_cast<float>(number) >= samples * alpha * alpha;
}

// Lobes of a surface that are asked for one after the other: [first, last]. The coat comes first: it may want rays,
// whose random numbers must not depend on whether the base draws any.
struct AskedLobes {
  int first = static_cast<int>(Lobe::all), last = static_cast<int>(Lobe::all);
};

OCTRAD_HD inline AskedLobes asked_lobes(const FirstHitOptions& options, const Bsdf& bsdf) {
  if (!options.split_coats || !has_lobes(bsdf)) return {};
  return {static_cast<int>(Lobe::coat), static_cast<int>(Lobe::base)};
}

// Calls ask() with `point` restricted to each of them.
OCTRAD_HD_OR_HOST
template <typename Ask>
OCTRAD_HD inline void for_each_asked_lobe(const FirstHitOptions& options, ShadingPoint& point, const Ask& ask) {
  const AskedLobes lobes = asked_lobes(options, point.bsdf);
  for (int lobe = lobes.first; lobe <= lobes.last; ++lobe) {
    point.bsdf.lobe = static_cast<Lobe>(lobe);
    ask();
  }
}

// The points where a field is asked for a sample whose ray ended with `end`, by `segment` and `hit`, on a surface whose
// lobe is followed: calls count(points), 0 to 2, then ask(point, weight, segment, hit) for each. `known` takes the
// emission that the lobe shows, and RayEnd::rays counts its rays.
OCTRAD_HD_OR_HOST
template <typename World, typename Count, typename Ask>
OCTRAD_HD inline void ask_behind_lobe(const World& world, const FirstHitOptions& options, RayEnd& end,
                                      const Segment& segment, const Hit& hit, Rng& rng, Vec3f& known,
                                      const Count& count, const Ask& ask) {
  Segment last;
  Hit met;
  const bool coated = is_coated(end.point.bsdf);
  if (coated) end.point.bsdf.lobe = Lobe::coat;
  RayEnd far = follow_lobe(world, end.point, rng, options.follow_below, options.max_chain, last, met);
  end.rays += far.rays;
  known += end.throughput * far.emitted;
  count((far.surface ? 1 : 0) + (coated ? 1 : 0));
  if (far.surface) {
    float weight = 1.0f;  // one lobe there, as right-hand sides ask
    if (has_lobes(far.point.bsdf))
      weight = choose_lobe(far.point.bsdf, far.point.to_local(far.point.wo), rng.stratified());
    ask(far.point, end.throughput * far.throughput * weight, last, met);
  }
  if (!coated) return;
  end.point.bsdf.lobe = Lobe::base;
  ask(end.point, end.throughput, segment, hit);
}

// The same for sample `number` of a pixel, whether it follows the lobe or not.
OCTRAD_HD_OR_HOST
template <typename World, typename Count, typename Ask>
OCTRAD_HD inline void for_each_asked_point(const World& world, const FirstHitOptions& options, int number, RayEnd& end,
                                           const Segment& segment, const Hit& hit, Rng& rng, Vec3f& known,
                                           const Count& count, const Ask& ask) {
  if (follows_lobe<World::kModels>(options, end.point.bsdf, number))
    return ask_behind_lobe(world, options, end, segment, hit, rng, known, count, ask);
  const AskedLobes lobes = asked_lobes(options, end.point.bsdf);
  count(lobes.last - lobes.first + 1);
  for_each_asked_lobe(options, end.point, [&] { ask(end.point, end.throughput, segment, hit); });
}

// What is left to find out about a camera sample whose ray has ended. The radiance of the sample is `known` plus
// RayEnd::throughput times the field's response, or times the right-hand side at the bounce point.
struct FirstHitQuery {
  enum class Next { nothing, query, bounce } next = Next::nothing;
  Vec3f known{0, 0, 0};        // emission and environment seen that no response holds
  unsigned long long key = 0;  // bounce: of the sample (Rng::sample_key)
};

// `first`: of the ray; `rng`: the sample's generator after it was followed.
template <Models kModels = Models::all>
OCTRAD_HD inline FirstHitQuery first_hit_query(const FirstHitOptions& options, bool hides_emitters, const RayEnd& end,
                                               const FirstHit& first, const Rng& rng) {
  using Bounce = FirstHitOptions::Bounce;
  FirstHitQuery query;
  if (hides_emitters && !first.valid) return query;
  query.known = end.first_emitted + end.emitted;
  if (!end.surface) return query;
  if (options.bounce == Bounce::all ||
      (options.bounce == Bounce::glossy && roughness_bsdf<kModels>(end.point.bsdf) < options.rough_threshold &&
       (options.bounce_delta || !is_delta_bsdf(end.point.bsdf)))) {
    query.next = FirstHitQuery::Next::bounce;
    query.key = rng.sample_key();
    return query;
  }
  query.next = FirstHitQuery::Next::query;
  if (options.emission_inside) query.known = end.passed_emitted;
  return query;
}

// Follows a camera's ray to its end. `first`: attributes of the first hit.
OCTRAD_HD_OR_HOST
template <typename World>
OCTRAD_HD inline RayEnd follow_camera_ray(const World& world, const FollowRules& rules, const Ray& ray, Rng& rng,
                                          FirstHit& first) {
  RayEnd end;
  if (rules.max_chain < 0) return end;
  Segment segment = first_segment(ray.origin, nullptr, ray.direction, ray.t_max);
  int rays = 0;
  Hit hit = camera_hit(world, ray, rays);
  end.rays = rays - 1;  // follow_hit() counts the last
  follow_from(world, ray.origin, hit, rng, rules.follow_below, rules.max_chain, segment, end, &first);
  return end;
}

// The same for a camera sample, and what it asks.
OCTRAD_HD_OR_HOST
template <typename World>
OCTRAD_HD inline FirstHitQuery trace_first_hit(const World& world, const FirstHitOptions& options, CameraSample& sample,
                                               RayEnd& end, FirstHit& first) {
  end = follow_camera_ray(world, options, sample.ray, sample.rng, first);
  return first_hit_query<World::kModels>(options, world.hides_emitters(), end, first, sample.rng);
}

// The point as it is given to a field, with what trace_offset() fills in; `rng`: null where the ray has no spread.
OCTRAD_HD_OR_HOST
template <typename World>
OCTRAD_HD inline SurfacePoint field_query_point(const World& world, const ShadingPoint& shading,
                                                const OffsetRay& offset, Rng* rng = nullptr) {
  SurfacePoint point = surface_point<World::kModels>(shading);
  const Vec3f normal = shading.surface.geometric_normal;
  trace_offset(world, offset, normal, point,
               rng != nullptr ? draw_offset_direction(offset, point, normal, *rng) : Vec3f(0.0f));
  return point;
}

}  // namespace octrad
