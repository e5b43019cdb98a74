#include "octrad/render/cache_integrators.h"

#include "octrad/base/error.h"
#include "octrad/transport/rhs_estimator.h"

namespace octrad {
namespace {

// Where a camera sample's ray ends, and the attributes of its first hit: of a mirror, also where the ray goes on.
RayEnd primary_hit(const TransportContext& context, const Config& config, CameraSample& sample, PixelSample& out) {
  FirstHit first;
  const RayEnd end =
      follow_ray(context, sample.ray.origin, nullptr, sample.ray.direction, sample.rng,
                 config.render_delta == DeltaSurfaces::trace, config.train_max_chain, sample.ray.t_max, &first);
  out = {Vec3f(0.0f), first.albedo, first.normal, first.depth, first.roughness};
  return end;
}

}  // namespace

SampleFunction cache_integrator(const TransportContext& context, const RadianceField& field, const Config& config,
                                CacheMode mode, int directions, unsigned long long seed) {
  const bool inside = config.target_emission == TargetEmission::inside;
  const bool traced = config.lookup_offset == LookupOffset::traced;
  const auto rough = static_cast<float>(config.lookup_rough_threshold);
  return [=, &context, &field, &config](std::span<CameraSample> samples, std::span<PixelSample> out) {
    SampleCounts counts;
    std::vector<SurfacePoint> asked;
    std::vector<std::size_t> asked_by;
    std::vector<Vec3f> asked_weight;
    std::vector<ShadingPoint> bounced;
    std::vector<std::size_t> bounced_by;
    std::vector<Vec3f> bounced_weight;
    std::vector<unsigned long long> bounced_key;  // a camera sample's own random stream
    for (std::size_t i = 0; i < samples.size(); ++i) {
      const RayEnd end = primary_hit(context, config, samples[i], out[i]);
      counts.rays += end.rays;
      const bool bounce =
          end.surface && (mode == CacheMode::rhs || (mode == CacheMode::deferred && roughness(end.point.bsdf) < rough));
      // A field trained on total radiance holds the emission of what it is asked about; everything else is added here.
      const bool emission_known = end.surface && inside && !bounce;
      out[i].radiance += emission_known ? end.passed_emitted : end.first_emitted + end.emitted;
      if (!end.surface) continue;
      if (bounce) {
        bounced.push_back(end.point);
        bounced_by.push_back(i);
        bounced_weight.push_back(end.throughput);
        const unsigned long long high = samples[i].rng.bits();
        bounced_key.push_back((high << 32) | samples[i].rng.bits());
      } else {
        asked.push_back(surface_point(end.point));
        if (traced) {
          asked.back().disparity = traced_disparity(context, asked.back(), end.point.surface.geometric_normal);
          ++counts.rays;
        }
        asked_by.push_back(i);
        asked_weight.push_back(end.throughput);
      }
    }
    std::vector<Vec3f> answers(asked.size());
    field.radiance(asked, answers);
    counts.queries += static_cast<long long>(asked.size());
    for (std::size_t q = 0; q < asked.size(); ++q) out[asked_by[q]].radiance += asked_weight[q] * answers[q];
    if (!bounced.empty()) {
      RhsOptions rhs;
      rhs.directions = directions;
      rhs.max_chain = config.train_max_chain;
      rhs.emission_inside = inside;
      rhs.traced_disparity = traced;
      rhs.seed = seed;
      rhs.keys = bounced_key;
      answers.resize(bounced.size());
      const RadianceQuery query = [&](std::span<const SurfacePoint> points, std::span<Vec3f> values) {
        field.radiance(points, values);
      };
      const RhsStatistics s = estimate_rhs_serial(context, bounced, rhs, query, answers);
      counts.rays += s.rays;
      counts.queries += s.queries;
      counts.non_finite += s.non_finite;
      for (std::size_t b = 0; b < bounced.size(); ++b) out[bounced_by[b]].radiance += bounced_weight[b] * answers[b];
    }
    return counts;
  };
}

}  // namespace octrad
