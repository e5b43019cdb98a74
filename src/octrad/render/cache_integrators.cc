// Integrators that query a radiance field (method section 8): `lhs`, `rhs`, `deferred`.
#include <vector>

#include "octrad/base/flat.h"
#include "octrad/model/radiance_field.h"
#include "octrad/render/highlights.h"
#include "octrad/render/integrators.h"
#include "octrad/transport/prepared_scene.h"
#include "octrad/transport/query_point.h"
#include "octrad/transport/rhs_estimator.h"

namespace octrad {
namespace {

class CacheIntegrator : public Integrator {
 public:
  CacheIntegrator(const IntegratorInput& input, FirstHitOptions::Bounce bounce)
      : context_(input.scene.context()),
        field_(*input.field),
        options_(first_hit_options(input, bounce)),
        rays_(picture_rays(input.config)),
        rhs_(rhs_rules(input.config)) {
    rhs_.directions = 1;  // each camera sample has its own first hit
    rhs_.rays = query_rays(input.config);
    rhs_.seed = input.seed;
  }

  SampleCounts sample(std::span<CameraSample> samples, std::span<PixelSample> out) override {
    SampleCounts counts;
    std::vector<SurfacePoint> queries;
    std::vector<Owner> query_owners, bounce_owners;
    std::vector<ShadingPoint> bounces;
    std::vector<unsigned long long> bounce_keys;
    const auto trace = [&](std::size_t i) {
      RayEnd end;
      FirstHit first;
      const FirstHitQuery query = trace_first_hit(context_, options_, samples[i], end, first);
      Vec3f known = query.known;
      if (query.next == FirstHitQuery::Next::bounce) {
        bounces.push_back(end.point);
        bounce_owners.push_back({i, end.throughput});
        bounce_keys.push_back(query.key);
      } else if (query.next == FirstHitQuery::Next::query) {
        const auto ask = [&](const ShadingPoint& point, Vec3f weight, const Segment&, const Hit&) {
          queries.push_back(field_query_point(context_, point, rays_, samples[i].rng));
          query_owners.push_back({i, weight});
          counts.rays += rays_.count(queries.back().alpha);
        };
        for_each_asked_point(
            context_, options_, samples[i].number, end, {}, {}, samples[i].rng, known, [](int) {}, ask);
      }
      counts.rays += end.rays;
      out[i] = pixel_sample(known, first);
    };
    run_flat([&] {
      for (std::size_t i = 0; i < samples.size(); ++i) trace(i);
    });
    std::vector<Vec3f> responses(queries.size());
    field_.radiance(queries, responses);
    counts.queries += static_cast<long long>(queries.size());
    add(query_owners, responses, out);
    if (!bounces.empty()) {
      RhsOptions rhs = rhs_;
      rhs.keys = bounce_keys;
      responses.resize(bounces.size());
      const RadianceQuery ask = [this](std::span<const SurfacePoint> points, std::span<Vec3f> values) {
        field_.radiance(points, values);
      };
      counts += sample_counts(estimate_rhs_serial(context_, bounces, rhs, ask, responses));
      add(bounce_owners, responses, out);
    }
    return counts;
  }

 private:
  struct Owner {
    std::size_t sample;
    Vec3f weight;
  };
  static void add(const std::vector<Owner>& owners, const std::vector<Vec3f>& responses, std::span<PixelSample> out) {
    for (std::size_t q = 0; q < owners.size(); ++q) out[owners[q].sample].radiance += owners[q].weight * responses[q];
  }

  const TransportContext context_;
  const RadianceField& field_;
  const FirstHitOptions options_;
  const QueryRays rays_;
  RhsOptions rhs_;
};

}  // namespace

FirstHitOptions first_hit_options(const IntegratorInput& input, FirstHitOptions::Bounce bounce) {
  const Config& config = input.config;
  FirstHitOptions options(first_hit_rules(config));
  options.bounce = bounce;
  options.rough_threshold = static_cast<float>(config.lookup_rough_threshold);
  options.coat_samples = static_cast<float>(config.render_coat_samples);
  if (bounce != FirstHitOptions::Bounce::none) return options;
  options.metal_samples = static_cast<float>(config.render_metal_samples);
  if (const float below = bounce_below(input.scene, config); below > 0.0f) {
    options.bounce = FirstHitOptions::Bounce::glossy;
    options.rough_threshold = below;
    options.bounce_delta = false;
  }
  return options;
}

std::unique_ptr<Integrator> make_cache_integrator(const IntegratorInput& input, FirstHitOptions::Bounce bounce) {
  return std::make_unique<CacheIntegrator>(input, bounce);
}

}  // namespace octrad
