// One step of a path, for host and device: what trace_paths() does at each vertex (transport/path.h).
#pragma once

#include <cmath>
#include <limits>

#include "octrad/shading/light_sample.h"
#include "octrad/transport/camera_hit_math.h"
#include "octrad/transport/follow_math.h"

namespace octrad {

struct PathLimits {
  int max_depth = -1;  // Mitsuba's meaning: 1 emission only, 2 direct light, ...; -1 unlimited
  int rr_depth = 5;    // Russian roulette from this many scattering events on
};

// A path between two vertices.
struct PathState {
  Vec3f origin, direction;
  Vec3f vertex;  // where the last scattering took place: `origin` before it was pushed off the surface
  float t_max = 0.0f;
  Vec3f throughput{1, 1, 1};
  float eta = 1.0f;            // product of relative indices: radiance shrinks by 1 / eta^2 inside glass and comes back
  float previous_pdf = 1.0f;   // of the direction that led here
  bool previous_delta = true;  // next-event estimation could not have found what this ray hits
  int depth = 0;
  float passed = 0.0f;  // distance of masked surfaces already passed, for the first hit's depth
};

// Random numbers of next-event estimation.
struct LightNumbers {
  float u_pick;
  Vec2f u;
};

OCTRAD_HD inline LightNumbers draw_light_numbers(Rng& rng) {
  LightNumbers numbers;
  numbers.u_pick = rng.uniform();
  numbers.u = rng.uniform2();
  return numbers;
}

// The light sample of a vertex. Where there is an environment, its numbers are drawn as soon as the hit is known, so
// that memory can be loaded early: `early` are these.
template <typename World>
OCTRAD_HD inline LightSample sample_light_of_path(const World& world, const LightNumbers& early, Vec3f x, Rng& rng) {
  const LightNumbers numbers = world.has_environment() ? early : draw_light_numbers(rng);
  return world.sample_light(x, numbers.u_pick, numbers.u);
}

// A shadow ray, and its contribution if it is unoccluded.
struct Connection {
  RayQuery ray;
  Vec3f contribution;
};

// Contribution of a path that left the scene. `met`: after a surface, not after masks alone (FirstHit::valid).
OCTRAD_HD_OR_HOST
template <typename World>
OCTRAD_HD inline Vec3f path_escape(const World& world, const PathState& path, bool met) {
  if (!met && world.hides_emitters()) return Vec3f(0.0f);
  float light_pdf = 0.0f;
  const Vec3f radiance = path.previous_delta ? world.environment(path.direction)
                                             : world.environment(path.vertex, path.direction, light_pdf);
  return path.throughput * radiance * (path.previous_pdf / (path.previous_pdf + light_pdf));
}

// Emission, next-event estimation and the next direction at the surface that the path hit after `distance`. False where
// the path ends. sample_light(x, rng): a light sample as seen from `x`. `connect` gets at most one Connection:
// connect(ray, contribution).
OCTRAD_HD_OR_HOST
template <typename World, typename SampleLight, typename Connect>
OCTRAD_HD inline bool path_scatter(const World& world, const PathLimits& limits, const SurfaceInteraction& surface,
                                   float distance, SampleLight sample_light, PathState& path, Rng& rng, Vec3f& radiance,
                                   FirstHit& first, Connect connect) {
  if (surface.emitter >= 0) {
    const Vec3f emitted = world.emitted(surface, -path.direction);
    if (max_component(emitted) > 0.0f) {
      const float weight =
          path.previous_delta ? 1.0f : path.previous_pdf / (path.previous_pdf + world.light_pdf(path.vertex, surface));
      radiance += path.throughput * emitted * weight;
    }
  }
  const bool last = limits.max_depth > 0 && path.depth + 1 >= limits.max_depth;
  if (last && first.valid) return false;
  const ShadingPoint point = world.shade(surface, -path.direction);
  const Bsdf& bsdf = point.bsdf;
  const Vec3f wo = point.to_local(-path.direction);
  const float u_lobe = rng.uniform();
  if (!first.valid && u_lobe < bsdf.opacity) first = first_hit_of<World::kModels>(point, path.passed + distance);
  if (last || (point.black && bsdf.opacity >= 1.0f)) return false;

  if (!is_delta_bsdf(bsdf) && world.has_lights()) {
    const LightSample light = sample_light(surface.position, rng);
    if (light.valid) {
      const BsdfValue f = evaluate_bsdf<World::kModels>(bsdf, wo, point.to_local(light.direction));
      if (max_component(f.value) > 0.0f) {
        RayQuery ray = shadow_ray(surface.position, surface.geometric_normal, light);
        const float left = left_by_masks(world, light, ray);
        if (left > 0.0f)
          connect(ray, path.throughput * f.value * light.radiance * (left / light_mis_density(light, f.pdf)));
      }
    }
  }

  const BsdfSample s = sample_bsdf<World::kModels>(bsdf, wo, u_lobe, rng.uniform2());
  if (!s.valid) return false;
  path.throughput *= s.weight;
  path.eta *= s.eta;
  const float strongest = max_component(path.throughput);
  if (!(strongest > 0.0f)) return false;
  if (path.depth + 1 >= limits.rr_depth) {
    const float survive = std::fmin(strongest * path.eta * path.eta, 0.95f);
    if (rng.uniform() >= survive) return false;
    path.throughput *= 1.0f / survive;
  }
  if (!s.null) path.direction = normalize(point.to_world(s.wi));
  path.vertex = surface.position;
  path.origin = offset_origin(surface.position, surface.geometric_normal, path.direction);
  path.t_max = std::numeric_limits<float>::infinity();
  path.previous_pdf = s.pdf;
  path.previous_delta = s.delta;
  if (!first.valid) path.passed += distance;
  ++path.depth;
  return true;
}

}  // namespace octrad
