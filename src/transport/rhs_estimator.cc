#include "transport/rhs_estimator.h"

#include <algorithm>
#include <vector>

#include "base/sobol_math.h"
#include "base/threads.h"
#include "shading/bsdf_math.h"

namespace octrad {
namespace {

constexpr std::size_t kQueriesPerBlock = 512;  // enough for a field's SIMD kernels, small enough for the L2 cache

// A cache query that waits for its answer: which target it belongs to and the factor it comes with.
struct Pending {
  std::size_t target;
  Vec3f weight;
  Vec3f counted;                   // what the answer holds and was added already
};

// Direct light by emitter sampling, balance heuristic against BSDF sampling.
Vec3f emitter_sample(const TransportContext& context, const ShadingPoint& point, Vec3f wo, const SobolSet::Sample& u, RhsStatistics& statistics) {
  const LightSample light = context.lights.sample(point.surface.position, u.u1, u.u2);
  if (!light.valid || light.pdf <= 0.0f) return Vec3f(0.0f);
  const Vec3f wi = point.to_local(light.direction);
  const BsdfValue f = evaluate_bsdf(point.bsdf, wo, wi);
  if (max_component(f.value) <= 0.0f) return Vec3f(0.0f);
  const RayQuery ray = shadow_ray(point.surface.position, point.surface.geometric_normal, light);
  ++statistics.rays;
  if (context.tracer.occluded(ray.origin, ray.direction, 0.0f, ray.t_max)) return Vec3f(0.0f);
  return f.value * light.radiance * (1.0f / (light.pdf + f.pdf));
}

// Points [begin, end): traced first, then all their cache queries at once.
RhsStatistics estimate_block(const TransportContext& context, std::span<const ShadingPoint> points, const RhsOptions& options,
                             const RadianceQuery& query, std::span<Vec3f> targets, std::size_t begin, std::size_t end_point) {
  RhsStatistics statistics;
  thread_local std::vector<SurfacePoint> asked;
  thread_local std::vector<Pending> pending;
  thread_local std::vector<Vec3f> answers;
  asked.clear();
  pending.clear();
  const float share = 1.0f / static_cast<float>(options.directions);
  const auto add = [&](std::size_t i, Vec3f contribution) {
    if (is_finite(contribution)) targets[i] += contribution * share;
    else ++statistics.non_finite;
  };
  for (std::size_t i = begin; i < end_point; ++i) {
    const ShadingPoint& point = points[i];
    targets[i] = Vec3f(0.0f);
    const unsigned long long key = options.keys.empty() ? i : options.keys[i];
    Rng rng(options.seed, RngPurpose::rhs, mix64(options.stream * 0x9e3779b97f4a7c15ull + 1) ^ key);
    const Vec3f wo = point.to_local(point.wo);
    const bool delta_only = is_delta_bsdf(point.bsdf);
    const SobolSet light_set(rng), bsdf_set(rng);  // M stratified samples of each: less noise than M independent ones
    for (int m = 0; m < options.directions; ++m) {
      if (!delta_only) add(i, emitter_sample(context, point, wo, light_set(static_cast<std::uint32_t>(m)), statistics));
      const SobolSet::Sample u = bsdf_set(static_cast<std::uint32_t>(m));
      const BsdfSample scattered = sample_bsdf(point.bsdf, wo, u.u1, u.u2);
      if (!scattered.valid || max_component(scattered.weight) <= 0.0f) continue;
      const Vec3f direction = normalize(point.to_world(scattered.wi));
      const RayEnd end = follow_ray(context, point.surface.position, &point.surface.geometric_normal, direction, rng, true, options.max_chain);
      statistics.rays += end.rays;
      // Emission met first competes with emitter sampling; a delta lobe or a surface passed on the way rules that out.
      const float mis = scattered.delta ? 1.0f : scattered.pdf / (scattered.pdf + end.first_light_pdf);
      add(i, scattered.weight * (end.first_emitted * mis + end.emitted));
      if (!end.surface || !query) continue;
      SurfacePoint where = surface_point(end.point);
      if (options.traced_disparity) {
        where.disparity = traced_disparity(context, where, end.point.surface.geometric_normal);
        ++statistics.rays;
      }
      asked.push_back(where);
      pending.push_back({i, scattered.weight * end.throughput, options.emission_inside ? end.own_emitted : Vec3f(0.0f)});
    }
  }
  if (!asked.empty()) {
    answers.resize(asked.size());
    query(asked, answers);
    for (std::size_t q = 0; q < asked.size(); ++q) {
      // A lamp's prediction is emission and reflected light; the emission was counted above, under MIS. The clamp keeps out
      // negative light; what it cuts off is a small bright bias where the prediction of a lamp is noisy.
      Vec3f reflected = answers[q];
      if (max_component(pending[q].counted) > 0.0f) reflected = max(reflected - pending[q].counted, Vec3f(0.0f));
      add(pending[q].target, pending[q].weight * reflected);
    }
    statistics.queries += static_cast<long long>(asked.size());
  }
  return statistics;
}

std::size_t block_size(const RhsOptions& options) {
  return std::max<std::size_t>(1, kQueriesPerBlock / static_cast<std::size_t>(options.directions));
}

}  // namespace

float traced_disparity(const TransportContext& context, const SurfacePoint& point, Vec3f geometric_normal) {
  const Vec3f direction = reflect(point.wo, point.n);
  const Hit hit = context.tracer.intersect(offset_origin(point.x, geometric_normal, direction), direction, 0.0f, kRayInfinity);
  return hit.valid() && hit.t > 0.0f ? 1.0f / hit.t : 0.0f;
}

RhsStatistics estimate_rhs(const TransportContext& context, std::span<const ShadingPoint> points, const RhsOptions& options,
                           const RadianceQuery& query, std::span<Vec3f> targets) {
  const std::size_t block = block_size(options);
  std::vector<RhsStatistics> statistics((points.size() + block - 1) / block);
  parallel_blocks(points.size(), block, [&](std::size_t begin, std::size_t end) {
    statistics[begin / block] = estimate_block(context, points, options, query, targets, begin, end);
  });
  RhsStatistics total;
  for (const RhsStatistics& s : statistics) total += s;
  return total;
}

RhsStatistics estimate_rhs_serial(const TransportContext& context, std::span<const ShadingPoint> points, const RhsOptions& options,
                                  const RadianceQuery& query, std::span<Vec3f> targets) {
  RhsStatistics total;
  for (std::size_t begin = 0; begin < points.size(); begin += block_size(options)) {
    total += estimate_block(context, points, options, query, targets, begin, std::min(points.size(), begin + block_size(options)));
  }
  return total;
}

}  // namespace octrad
