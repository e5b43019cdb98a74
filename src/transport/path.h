// Path tracing estimator of the radiance along camera rays.
#pragma once

#include <span>

#include "base/rng.h"
#include "transport/context.h"

namespace octrad {

struct PathLimits {
  int max_depth = -1;              // Mitsuba's meaning: 1 emission only, 2 direct light, ...; -1 unlimited
  int rr_depth = 5;                // Russian roulette from this many scattering events on
};

// Attributes of the first surface seen (method section 1); where a mask lets the ray pass, of the one behind it.
struct FirstHit {
  bool valid = false;              // false: the ray met nothing; the rest keeps these values
  Vec3f albedo{0, 0, 0};
  Vec3f normal{0, 0, 0};           // shading normal, on the side of the viewer
  float depth = 0.0f;              // distance along the ray
  float roughness = 1.0f;
};

struct PathCounters {
  long long rays = 0;              // closest-hit and shadow rays
};

// One path: where it starts, its random numbers, and what was found.
struct PathSample {
  Ray ray;
  Rng rng;
  Vec3f radiance{0, 0, 0};
  FirstHit first;
};

// Unbiased estimates of the radiance that arrives along each ray: next-event estimation of one emitter and one BSDF
// sample at every vertex, combined by the balance heuristic (Veach 1997, section 9.2), so that a light of density p_l
// reached with f contributes f L / (p_l + p_b) from both. Transparent masks block shadow rays and count as a bounce, as
// in Mitsuba's `path`.
//
// Each result depends on its own ray and random numbers; many at once are faster, because the paths take their steps in
// turn, rays are cast in packets and memory is fetched for one path while others compute. Packets may round a hit's
// position differently than single rays do: the same bits need the same paths in the same order.
void trace_paths(const TransportContext& context, const PathLimits& limits, std::span<PathSample> paths, PathCounters& counters);

}  // namespace octrad
