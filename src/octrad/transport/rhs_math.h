// The two samples of one direction of the right-hand side (transport/rhs_estimator.h), for host and device.
#pragma once

#include "octrad/transport/follow_math.h"

namespace octrad {

// What tells the random numbers of a point from those of others: its place in the batch, or the Rng::sample_key() of
// the camera sample that saw it.
struct RhsKey {
  unsigned long long number;
  bool seen;
};

// The key of point `i`. `keys`: those of the camera samples that saw the points; null: none did.
OCTRAD_HD inline RhsKey rhs_key(const unsigned long long* keys, std::size_t i) {
  return keys != nullptr ? RhsKey{keys[i], true} : RhsKey{i, false};
}

// What keeps the random numbers of one stream (the step of a training) apart from those of others.
OCTRAD_HD inline std::uint64_t stream_index(unsigned long long stream) {
  return mix64(stream * 0x9e3779b97f4a7c15ull + 1);
}

// Random numbers of a point in `stream`.
OCTRAD_HD inline Rng rhs_generator(unsigned long long seed, unsigned long long stream, RhsKey key) {
  const std::uint64_t index = stream_index(stream);
  if (key.seen) return Rng::of_sample_key(seed, RngPurpose::rhs, index, key.number);
  return Rng(seed, RngPurpose::rhs, index ^ key.number);
}

// Random numbers of the chain of direction `m` (masks, mirrors and glass that the ray passes): a generator for each
// direction, so that all can be followed in parallel.
OCTRAD_HD inline Rng rhs_chain_generator(unsigned long long seed, unsigned long long stream, RhsKey key,
                                         std::uint32_t m) {
  const std::uint64_t index = stream_index(stream);
  if (key.seen) return Rng::of_sample_key(seed, RngPurpose::chain, mix64(index) + m, key.number);
  return Rng(seed, RngPurpose::chain, mix64(index ^ key.number) + m);
}

// A direction drawn from the BSDF, or from the mixture of guide and BSDF.
struct BounceSample {
  bool valid = false;
  bool delta = false;
  Vec3f direction;  // world
  Vec3f weight{0, 0, 0};
  float pdf = 0.0f;
  float bsdf_pdf = 0.0f;  // of the BSDF alone
};

template <Models kModels = Models::all>
OCTRAD_HD inline BounceSample sample_bounce(const ShadingPoint& point, Vec3f wo, const SobolSet::Sample& u,
                                            const Guide& guide = {}) {
  BounceSample sample;
  if (guide.known() && u.u1 < guide.share) {
    const Vec3f direction = guide_direction(guide.rows, guide.columns, u.u2);
    const BsdfValue f = evaluate_bsdf<kModels>(point.bsdf, wo, point.to_local(direction));
    if (max_component(f.value) <= 0.0f) return sample;
    sample.valid = true;
    sample.direction = direction;
    sample.bsdf_pdf = f.pdf;
    sample.pdf = guide.density(direction, f.pdf);
    sample.weight = f.value * (1.0f / sample.pdf);
    return sample;
  }
  const float u_lobe = guide.known() ? lesser((u.u1 - guide.share) / (1.0f - guide.share), 0.99999994f) : u.u1;
  const BsdfSample scattered = sample_bsdf<kModels>(point.bsdf, wo, u_lobe, u.u2);
  if (!scattered.valid || max_component(scattered.weight) <= 0.0f) return sample;
  sample.valid = true;
  sample.delta = scattered.delta;
  sample.direction = normalize(point.to_world(scattered.wi));
  sample.weight = scattered.weight;
  sample.pdf = sample.bsdf_pdf = scattered.pdf;
  if (guide.known()) {
    // A delta lobe is drawn by the BSDF alone.
    sample.pdf =
        scattered.delta ? (1.0f - guide.share) * scattered.pdf : guide.density(sample.direction, scattered.pdf);
    sample.weight *= scattered.delta ? 1.0f / (1.0f - guide.share) : scattered.pdf / sample.pdf;
  }
  return sample;
}

// Where a coated surface ends a ray and its lobes are points of their own, one of them is asked for by chance.
OCTRAD_HD inline void ask_one_lobe(RayEnd& end, Rng& rng) {
  if (!has_lobes(end.point.bsdf)) return;
  end.throughput *= choose_lobe(end.point.bsdf, end.point.to_local(end.point.wo), rng.uniform());
}

// Emission met by the BSDF ray. At the end of the first segment it is weighted against emitter sampling (MIS); not
// after a delta lobe, nor behind a surface that the ray passed, where emitter sampling cannot find it.
OCTRAD_HD inline Vec3f bounce_emission(Vec3f weight, float pdf, bool delta, const RayEnd& end) {
  const float mis = delta ? 1.0f : pdf / (pdf + end.first_light_pdf);
  return weight * (end.first_emitted * mis + end.emitted);
}

// Contribution of the cache at the end of the BSDF ray. The prediction for an emitter may include its emission
// (`counted`; 0 otherwise), which was added under MIS already. The difference may be negative: clamped here, it would
// brighten whatever sees an emitter whose prediction is noisy. cache_sum() clamps the sum over a point's directions.
OCTRAD_HD inline Vec3f cache_contribution(Vec3f weight, Vec3f response, Vec3f counted) {
  return weight * (response - counted);
}

// What all of a point's responses contribute. An untrained cache that knows nothing of the emission takes away no light
// that was sampled.
OCTRAD_HD inline Vec3f cache_sum(Vec3f contributions, bool emission_inside) {
  return emission_inside ? max(contributions, Vec3f(0.0f)) : contributions;
}

}  // namespace octrad
