#include "transport/path.h"

#include <limits>

#include "shading/bsdf_math.h"

namespace octrad {

Vec3f trace_path(const TransportContext& context, const Ray& ray, const PathLimits& limits, Rng& rng, FirstHit& first, PathCounters& counters) {
  Vec3f radiance{0, 0, 0};
  if (limits.max_depth == 0) return radiance;
  Vec3f origin = ray.origin, direction = ray.direction;
  float t_max = ray.t_max;
  Vec3f throughput{1, 1, 1};
  float eta = 1.0f;                // product of relative indices: radiance shrinks by 1 / eta^2 inside glass and comes back
  float previous_pdf = 1.0f;       // of the direction that led here
  bool previous_delta = true;      // no next-event estimation could have found what this ray finds
  float passed = 0.0f;             // distance of masked surfaces already passed, for the first hit's depth
  const bool bounded = limits.max_depth > 0;
  for (int depth = 0;; ++depth) {
    const Hit hit = context.tracer.intersect(origin, direction, 0.0f, t_max);
    ++counters.rays;
    if (!hit.valid()) {
      if (context.lights.has_environment()) {
        const float weight = previous_delta ? 1.0f : previous_pdf / (previous_pdf + context.lights.environment_pdf(direction));
        radiance += throughput * context.lights.environment(direction) * weight;
      }
      break;
    }
    const SurfaceInteraction surface = interact(context.scene, hit, origin, direction);
    if (surface.emitter >= 0) {
      const Vec3f emitted = context.lights.emitted(surface, -direction);
      if (max_component(emitted) > 0.0f) {
        const float weight = previous_delta ? 1.0f : previous_pdf / (previous_pdf + context.lights.pdf(origin, surface));
        radiance += throughput * emitted * weight;
      }
    }
    const bool last = bounded && depth + 1 >= limits.max_depth;
    if (last && first.valid) break;
    const ShadingPoint point = shade(context.materials, surface, -direction);
    const Bsdf& bsdf = point.bsdf;
    const Vec3f wo = point.to_local(-direction);
    const float u_lobe = rng.uniform();
    if (!first.valid && !(u_lobe >= bsdf.opacity)) {
      first.valid = true;
      first.albedo = point.black ? Vec3f(0.0f) : albedo_bsdf(bsdf);
      first.normal = dot(point.ns, direction) > 0.0f ? -point.ns : point.ns;
      first.depth = passed + hit.t;
      first.roughness = roughness_bsdf(bsdf);
    }
    if (last || point.black) break;

    if (!is_delta_bsdf(bsdf) && !context.lights.empty()) {
      const float u_pick = rng.uniform();
      const LightSample light = context.lights.sample(surface.position, u_pick, rng.uniform2());
      if (light.valid) {
        const BsdfValue f = evaluate_bsdf(bsdf, wo, point.to_local(light.direction));
        if (max_component(f.value) > 0.0f) {
          const Vec3f from = offset_origin(surface.position, surface.geometric_normal, light.direction);
          ++counters.rays;
          if (!context.tracer.occluded(from, light.direction, 0.0f, light.distance * kShadowShortening)) {
            radiance += throughput * f.value * light.radiance * (1.0f / (light.pdf + f.pdf));
          }
        }
      }
    }

    const BsdfSample s = sample_bsdf(bsdf, wo, u_lobe, rng.uniform2());
    if (!s.valid) break;
    throughput *= s.weight;
    eta *= s.eta;
    const float strongest = max_component(throughput);
    if (!(strongest > 0.0f)) break;
    if (depth + 1 >= limits.rr_depth) {
      const float survive = std::fmin(strongest * eta * eta, 0.95f);
      if (rng.uniform() >= survive) break;
      throughput *= 1.0f / survive;
    }
    direction = s.null ? direction : normalize(point.to_world(s.wi));
    origin = offset_origin(surface.position, surface.geometric_normal, direction);
    t_max = std::numeric_limits<float>::infinity();
    previous_pdf = s.pdf;
    previous_delta = s.delta;
    if (!first.valid) passed += hit.t;
  }
  return radiance;
}

}  // namespace octrad
