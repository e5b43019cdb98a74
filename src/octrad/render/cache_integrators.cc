#include "octrad/render/cache_integrators.h"

#include "octrad/base/error.h"
#include "octrad/transport/first_hit_math.h"
#include "octrad/transport/rhs_estimator.h"

namespace octrad {
namespace {

FirstHitOptions first_hit_options(const Config& config, CacheMode mode) {
  using Bounce = FirstHitOptions::Bounce;
  FirstHitOptions options;
  options.follow_delta = config.render_delta == DeltaSurfaces::trace;
  options.max_chain = config.train_max_chain;
  options.emission_inside = config.target_emission == TargetEmission::inside;
  options.bounce = mode == CacheMode::rhs ? Bounce::all : mode == CacheMode::deferred ? Bounce::glossy : Bounce::none;
  options.rough_threshold = static_cast<float>(config.lookup_rough_threshold);
  return options;
}

}  // namespace

SampleFunction cache_integrator(const TransportContext& context, const RadianceField& field, const Config& config,
                                CacheMode mode, int directions, unsigned long long seed) {
  const FirstHitOptions options = first_hit_options(config, mode);
  const bool traced = config.lookup_offset == LookupOffset::traced;
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
      RayEnd end;
      FirstHit first;
      const FirstHitQuery query = trace_first_hit(context, options, samples[i], end, first);
      counts.rays += end.rays;
      out[i] = {query.known, first.albedo, first.normal, first.depth, first.roughness};
      if (query.next == FirstHitQuery::Next::nothing) continue;
      if (query.next == FirstHitQuery::Next::bounce) {
        bounced.push_back(end.point);
        bounced_by.push_back(i);
        bounced_weight.push_back(end.throughput);
        bounced_key.push_back(query.key);
      } else {
        asked.push_back(field_query_point(context, end.point, traced));
        counts.rays += traced;
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
      rhs.emission_inside = options.emission_inside;
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
