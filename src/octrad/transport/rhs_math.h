// The two samples of one direction of the right-hand side (transport/rhs_estimator.h), for host and device.
#pragma once

#include "octrad/base/sobol_math.h"
#include "octrad/shading/light_sample.h"
#include "octrad/transport/follow_math.h"

namespace octrad {

// Random numbers of the point `key` in `stream`.
OCTRAD_HD inline Rng rhs_generator(unsigned long long seed, unsigned long long stream, unsigned long long key) {
  return Rng(seed, RngPurpose::rhs, mix64(stream * 0x9e3779b97f4a7c15ull + 1) ^ key);
}

// Of the way that direction `m` of the point takes through masks and over mirrors and glass: every direction its own,
// so that all can be followed at once.
OCTRAD_HD inline Rng rhs_chain_generator(unsigned long long seed, unsigned long long stream, unsigned long long key,
                                         std::uint32_t m) {
  return Rng(seed, RngPurpose::chain, mix64(mix64(stream * 0x9e3779b97f4a7c15ull + 1) ^ key) + m);
}

// Direct light by emitter sampling, balance heuristic against BSDF sampling: what arrives if the shadow ray is free.
struct EmitterSample {
  bool valid = false;
  RayQuery ray;
  Vec3f contribution{0, 0, 0};
};

OCTRAD_HD_OR_HOST
template <typename World>
OCTRAD_HD inline EmitterSample sample_emitter(const World& world, const ShadingPoint& point, Vec3f wo,
                                              const SobolSet::Sample& u) {
  EmitterSample sample;
  const LightSample light = world.sample_light(point.surface.position, u.u1, u.u2);
  if (!light.valid || light.pdf <= 0.0f) return sample;
  const Vec3f wi = point.to_local(light.direction);
  const BsdfValue f = evaluate_bsdf(point.bsdf, wo, wi);
  if (max_component(f.value) <= 0.0f) return sample;
  sample.valid = true;
  sample.ray = shadow_ray(point.surface.position, point.surface.geometric_normal, light);
  sample.contribution = f.value * light.radiance * (1.0f / (light.pdf + f.pdf));
  return sample;
}

// The BSDF's own choice of a direction.
struct BounceSample {
  bool valid = false;
  bool delta = false;
  Vec3f direction;  // world
  Vec3f weight{0, 0, 0};
  float pdf = 0.0f;
};

OCTRAD_HD inline BounceSample sample_bounce(const ShadingPoint& point, Vec3f wo, const SobolSet::Sample& u) {
  BounceSample sample;
  const BsdfSample scattered = sample_bsdf(point.bsdf, wo, u.u1, u.u2);
  if (!scattered.valid || max_component(scattered.weight) <= 0.0f) return sample;
  sample.valid = true;
  sample.delta = scattered.delta;
  sample.direction = normalize(point.to_world(scattered.wi));
  sample.weight = scattered.weight;
  sample.pdf = scattered.pdf;
  return sample;
}

// Emission on the bounce's way. What is met first competes with emitter sampling; a delta lobe or a surface passed on
// the way rules that out.
OCTRAD_HD inline Vec3f bounce_emission(Vec3f weight, float pdf, bool delta, const RayEnd& end) {
  const float mis = delta ? 1.0f : pdf / (pdf + end.first_light_pdf);
  return weight * (end.first_emitted * mis + end.emitted);
}

// What the cache says of the bounce's end. A lamp's prediction may be emission and reflected light (`counted`: the
// emission, 0 otherwise); the emission was counted under MIS. The clamp keeps out negative light; what it cuts off is a
// small bright bias where the prediction of a lamp is noisy.
OCTRAD_HD inline Vec3f answer_contribution(Vec3f weight, Vec3f answer, Vec3f counted) {
  if (max_component(counted) > 0.0f) answer = max(answer - counted, Vec3f(0.0f));
  return weight * answer;
}

}  // namespace octrad
