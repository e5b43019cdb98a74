// Path tracing estimator of the radiance along camera rays.
#pragma once

#include <span>

#include "octrad/transport/context.h"
#include "octrad/transport/path_math.h"

namespace octrad {

struct PathCounters {
  long long rays = 0;  // closest-hit and shadow rays; a shadow ray that passes masks counts once
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
// in Mitsuba's `path`, except that shadow rays of lights with DeltaLight::through_masks pass them, as no bounce.
//
// Each result depends on its own ray and random numbers; many at once are faster, because paths are advanced
// together: rays are cast in packets, and memory is prefetched for one path while others compute. Packets may round a
// hit's position differently than single rays do: the same bits need the same paths in the same order.
void trace_paths(const TransportContext& context, const PathLimits& limits, std::span<PathSample> paths,
                 PathCounters& counters);

}  // namespace octrad
