// Rays drawn from a point's BSDF, to find out how far away what its lobe shows is (QueryRays::lobe), for host and
// device.
#pragma once

#include "octrad/transport/rhs_math.h"

namespace octrad {

// Random numbers for the rays of left-hand-side point `i` of step `stream`.
OCTRAD_HD inline Rng lobe_generator(unsigned long long seed, unsigned long long stream, unsigned long long i) {
  return Rng(seed, RngPurpose::lobe, mix64(stream * 0x9e3779b97f4a7c15ull + 1) ^ i);
}

struct LobeRay {
  bool valid = false;  // false: the sample carries no light and counts as a ray that met nothing
  bool delta = false;  // samples of a delta lobe are one and the same ray
  RayQuery ray;
};

// Ray `i` of a point; wo: local.
OCTRAD_HD inline LobeRay lobe_ray(const ShadingPoint& point, Vec3f wo, const SobolSet& samples, std::uint32_t i) {
  const BounceSample bounce = sample_bounce(point, wo, samples(i));
  if (!bounce.valid) return {};
  const Segment segment = first_segment(point.surface.position, &point.surface.geometric_normal, bounce.direction);
  return {true, bounce.delta, {segment.origin, segment.direction, segment.t_max}};
}

}  // namespace octrad
