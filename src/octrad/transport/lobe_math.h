// Rays drawn from a point's BSDF, to find out how far away what its lobe shows is (QueryRays::lobe), for host and
// device.
#pragma once

#include "octrad/transport/rhs_math.h"

namespace octrad {

// Random numbers for the rays of left-hand-side point `i` of step `stream`.
OCTRAD_HD inline Rng lobe_generator(unsigned long long seed, unsigned long long stream, unsigned long long i) {
  return Rng(seed, RngPurpose::lobe, stream_index(stream) ^ i);
}

// One ray of a point, drawn with a number of a SobolSet; wo: local. False where the sample carries no light: it counts
// as a ray that met nothing. `delta`: samples of a delta lobe are one and the same ray.
template <Models kModels = Models::all>
OCTRAD_HD inline bool lobe_ray(const ShadingPoint& point, Vec3f wo, const SobolSet::Sample& u, RayQuery& ray,
                               bool& delta) {
  const BounceSample bounce = sample_bounce<kModels>(point, wo, u);
  if (!bounce.valid) return false;
  const Segment segment = first_segment(point.surface.position, &point.surface.geometric_normal, bounce.direction);
  ray = {segment.origin, segment.direction, segment.t_max};
  delta = bounce.delta;
  return true;
}

}  // namespace octrad
