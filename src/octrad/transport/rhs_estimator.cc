#include "octrad/transport/rhs_estimator.h"

#include <algorithm>
#include <vector>

#include "octrad/base/flat.h"
#include "octrad/base/threads.h"
#include "octrad/transport/query_point.h"
#include "octrad/transport/rhs_math.h"

namespace octrad {
namespace {

constexpr std::size_t kQueriesPerBlock = 512;  // enough for a field's SIMD kernels, small enough for the L2 cache

// A cache query without its response yet: its target and weight.
struct PendingQuery {
  std::size_t target;
  Vec3f weight;
  Vec3f counted;       // the part of the response that was added already
  FarEnd end;          // where far ends are kept
  std::size_t sample;  // of the block
};

// Points [begin, end): traced first, then all their cache queries at once.
TraceCounts estimate_block(const TransportContext& context, std::span<const ShadingPoint> points,
                           const RhsOptions& options, const RadianceQuery& query, std::span<Vec3f> targets,
                           std::size_t begin, std::size_t end_point) {
  TraceCounts counts;
  thread_local std::vector<SurfacePoint> queried;
  thread_local std::vector<PendingQuery> pending;
  thread_local std::vector<Vec3f> responses;
  thread_local std::vector<GuideSample> samples;  // [points of the block][directions], where they teach
  thread_local std::vector<int> tables;           // of the points
  queried.clear();
  pending.clear();
  const bool teach = options.learn_guides && query && options.guides.rows != nullptr;
  const auto directions = static_cast<std::size_t>(options.directions);
  if (teach) {
    samples.assign((end_point - begin) * directions, GuideSample());
    tables.resize(end_point - begin);
  }
  const auto n = static_cast<std::uint32_t>(points.size());
  const FarEndRange range = far_end_range(options.stream, n, static_cast<std::uint32_t>(options.far_ends.size()));
  const float share = 1.0f / static_cast<float>(options.directions);
  const auto add = [&](std::size_t i, Vec3f contribution) {
    if (is_finite(contribution)) targets[i] += contribution * share;
    else ++counts.non_finite;
  };
  const auto trace = [&](std::size_t i) {
    const ShadingPoint& point = points[i];
    targets[i] = Vec3f(0.0f);
    if (const std::uint32_t place = range.place(static_cast<std::uint32_t>(i), n); place < range.count)
      options.far_ends[place] = FarEnd();
    const RhsKey key = rhs_key(options.keys.empty() ? nullptr : options.keys.data(), i);
    Rng rng = rhs_generator(options.seed, options.stream, key);
    const Vec3f wo = point.to_local(point.wo);
    const bool delta_only = is_delta_bsdf(point.bsdf);
    const int table = guide_table(options.guides, point, viewed_normal(point));
    const Guide guide = guide_of(options.guides, table);
    if (teach) tables[i - begin] = table;
    const SobolSet light_set(rng), bsdf_set(rng);  // M stratified samples of each: less noise than M independent ones
    for (int m = 0; m < options.directions; ++m) {
      const auto index = static_cast<std::uint32_t>(m);
      if (!delta_only) {
        EmitterSample light = sample_emitter(context, point, wo, light_set(index), guide);
        if (light.valid) {
          ++counts.rays;
          if (context.occluded(light.ray.origin, light.ray.direction, 0.0f, light.ray.t_max))
            light.contribution = Vec3f(0.0f);
          add(i, light.contribution);
        }
      }
      const BounceSample bounce = sample_bounce(point, wo, bsdf_set(index), guide);
      if (!bounce.valid) continue;
      Rng chain = rhs_chain_generator(options.seed, options.stream, key, index);
      RayEnd end;
      Segment segment = first_segment(point.surface.position, &point.surface.geometric_normal, bounce.direction);
      Hit hit = context.intersect(segment.origin, segment.direction, 0.0f, segment.t_max);
      follow_from(context, point.surface.position, hit, chain, options.follow_below, options.max_chain, segment, end);
      counts.rays += static_cast<unsigned long long>(end.rays);
      const Vec3f met = bounce_emission(bounce.weight, bounce.pdf, bounce.delta, end);
      add(i, met);
      const std::size_t sample = (i - begin) * directions + index;
      if (teach && table >= 0 && !bounce.delta) {
        samples[sample] = guide_sample(table, bounce.direction, bounce.pdf, bounce.bsdf_pdf);
        samples[sample].contribution = luminance(met);
      }
      if (!end.surface || !query) continue;
      if (options.split_coats) ask_one_lobe(end, chain);
      queried.push_back(field_query_point(context, end.point, options.rays, chain));
      counts.rays += static_cast<unsigned long long>(options.rays.count(queried.back().alpha));
      pending.push_back({i,
                         bounce.weight * end.throughput,
                         options.emission_inside ? end.own_emitted : Vec3f(0.0f),
                         {segment.origin, segment.direction, hit, end.point.bsdf.lobe},
                         sample});
    }
  };
  run_flat([&] {
    for (std::size_t i = begin; i < end_point; ++i) trace(i);
  });
  if (!queried.empty()) {
    responses.resize(queried.size());
    query(queried, responses);
    for (std::size_t q = 0; q < queried.size();) {
      const std::size_t i = pending[q].target;
      const std::uint32_t place = range.place(static_cast<std::uint32_t>(i), n);
      FarEndChoice choice(options.seed, options.stream, static_cast<std::uint32_t>(i));
      Vec3f sum(0.0f);
      for (; q < queried.size() && pending[q].target == i; ++q) {
        const Vec3f contribution = cache_contribution(pending[q].weight, responses[q], pending[q].counted);
        if (is_finite(contribution)) sum += contribution * share;
        else ++counts.non_finite;
        if (teach) samples[pending[q].sample].contribution += luminance(contribution);
        if (place < range.count && choice.take(contribution)) options.far_ends[place] = pending[q].end;
      }
      targets[i] += cache_sum(sum, options.emission_inside);
    }
    counts.queries += queried.size();
  }
  for (std::size_t i = begin; teach && i < end_point; ++i) {
    const int table = tables[i - begin];
    if (table < 0) continue;
    add_to_guide(options.guides, table, options.directions, targets[i]);
    for (std::size_t m = 0; m < directions; ++m)
      add_to_guide(options.guides, samples[(i - begin) * directions + m], targets[i], options.epsilon);
  }
  return counts;
}

std::size_t block_size(const RhsOptions& options) {
  return std::max<std::size_t>(1, kQueriesPerBlock / static_cast<std::size_t>(options.directions));
}

}  // namespace

TraceCounts estimate_rhs(const TransportContext& context, std::span<const ShadingPoint> points,
                         const RhsOptions& options, const RadianceQuery& query, std::span<Vec3f> targets) {
  const std::size_t block = block_size(options);
  std::vector<TraceCounts> of_blocks((points.size() + block - 1) / block);
  parallel_blocks(points.size(), block, [&](std::size_t begin, std::size_t end) {
    of_blocks[begin / block] = estimate_block(context, points, options, query, targets, begin, end);
  });
  TraceCounts total;
  for (const TraceCounts& counts : of_blocks) total += counts;
  return total;
}

TraceCounts estimate_rhs_serial(const TransportContext& context, std::span<const ShadingPoint> points,
                                const RhsOptions& options, const RadianceQuery& query, std::span<Vec3f> targets) {
  TraceCounts total;
  for (std::size_t begin = 0; begin < points.size(); begin += block_size(options)) {
    total += estimate_block(context, points, options, query, targets, begin,
                            std::min(points.size(), begin + block_size(options)));
  }
  return total;
}

}  // namespace octrad
