#include "octrad/transport/query_point.h"

#include "octrad/transport/first_hit_math.h"
#include "octrad/transport/hit_clusters_math.h"
#include "octrad/transport/rhs_math.h"

namespace octrad {
namespace {

// A thread's own: to initialise so much for every point would cost as much as its rays.
struct LobeScratch {
  RayQuery queries[kMostLobeRays];
  int drawn[kMostLobeRays];  // how often each was drawn: a delta lobe has one direction, whose ray is cast once
  Hit hits[kMostLobeRays];
  float distances[kMostLobeRays];
};

}  // namespace

SurfacePoint field_query_point(const TransportContext& context, const ShadingPoint& shading, const QueryRays& rays,
                               Rng& rng) {
  SurfacePoint point = field_query_point(context, shading, rays.offset);
  const int n = rays.lobe_rays(point.alpha);
  if (n == 0) return point;
  thread_local LobeScratch scratch;
  auto& [queries, drawn, hits, distances] = scratch;
  const Vec3f wo = shading.to_local(shading.wo);
  const SobolSet samples(rng);
  std::size_t cast = 0;
  for (int i = 0; i < n; ++i) {
    const BounceSample bounce = sample_bounce(shading, wo, samples(static_cast<std::uint32_t>(i)));
    if (!bounce.valid) continue;
    std::size_t same = 0;
    while (bounce.delta && same < cast && !(queries[same].direction == bounce.direction)) ++same;
    if (bounce.delta && same < cast) {
      ++drawn[same];
      continue;
    }
    drawn[cast] = 1;
    queries[cast++] = {offset_origin(point.x, shading.surface.geometric_normal, bounce.direction), bounce.direction,
                       kRayInfinity};
  }
  context.tracer.intersect(std::span<const RayQuery>(queries, cast), hits);
  int met = 0;
  for (std::size_t i = 0; i < cast; ++i) {
    for (int k = 0; hits[i].valid() && k < drawn[i]; ++k) distances[met++] = hits[i].t;
  }
  cluster_hits(distances, met, n, rays.clusters, rays.iterations, point.lobe);
  return point;
}

}  // namespace octrad
