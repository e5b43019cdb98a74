#include "octrad/transport/query_point.h"

#include "octrad/transport/first_hit_math.h"
#include "octrad/transport/hit_clusters_math.h"
#include "octrad/transport/lobe_math.h"

namespace octrad {
namespace {

// To compute them anew for every point would cost as much as the directions.
struct SobolPoints {
  std::uint32_t fraction[kMostLobeRays][3] = {};
  constexpr SobolPoints() {
    for (int i = 0; i < kMostLobeRays; ++i) sobol3(static_cast<std::uint32_t>(i), fraction[i]);
  }
};
constexpr SobolPoints kSobolPoints;

// A thread's own: to initialise so much for every point would cost as much as its rays.
struct LobeScratch {
  RayQuery rays[kMostLobeRays];
  int ray_of[kMostLobeRays];  // of each that was drawn: a delta lobe has one direction, whose ray is cast once
  Hit hits[kMostLobeRays];
  float distances[kMostLobeRays];
};

}  // namespace

SurfacePoint field_query_point(const TransportContext& context, const ShadingPoint& shading, const QueryRays& rays,
                               Rng& rng) {
  SurfacePoint point = field_query_point(context, shading, rays.offset, &rng);
  const int n = rays.lobe_rays(point.alpha);
  if (n == 0) return point;
  thread_local LobeScratch scratch;
  const Vec3f wo = shading.to_local(shading.wo);
  const SobolSet samples(rng);
  int cast = 0, drawn = 0;
  for (int i = 0; i < n; ++i) {
    RayQuery& ray = scratch.rays[cast];
    bool delta = false;
    if (!lobe_ray(shading, wo, samples(kSobolPoints.fraction[i]), ray, delta)) continue;
    int same = delta ? 0 : cast;
    while (same < cast && !(scratch.rays[same].direction == ray.direction)) ++same;
    cast += same == cast ? 1 : 0;
    scratch.ray_of[drawn++] = same;
  }
  context.tracer.intersect(std::span<const RayQuery>(scratch.rays, static_cast<std::size_t>(cast)), scratch.hits);
  int met = 0;
  for (int i = 0; i < drawn; ++i) {
    const Hit& hit = scratch.hits[scratch.ray_of[i]];
    if (hit.valid()) scratch.distances[met++] = hit.t;
  }
  cluster_hits(scratch.distances, met, n, rays.clusters, rays.iterations, point.lobe);
  return point;
}

}  // namespace octrad
