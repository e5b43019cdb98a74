#include <cmath>
#include <cstring>
#include <limits>

#include "octrad/base/rng.h"
#include "octrad/base/threads.h"
#include "octrad/transport/cast.h"
#include "octrad/transport/checks.h"

namespace octrad {
namespace {

template <bool kAnyHit, typename Out>
struct WarpRays : Kernel {
  Bvh8View tree;
  std::uint32_t n;
  const DeviceRay* rays;
  Out* out;
  static constexpr bool kAny = kAnyHit;
  OCTRAD_HD Bvh8View bvh() const { return tree; }
  OCTRAD_HD std::uint32_t size() const { return n; }
  OCTRAD_HD void count() const {}
  OCTRAD_HD RayQuery ray(std::uint32_t i) const { return {rays[i].origin, rays[i].direction, rays[i].t_max}; }
  OCTRAD_HD void met(std::uint32_t i, const Hit& hit) const { out[i] = hit; }
  OCTRAD_HD void met(std::uint32_t i, bool any) const { out[i] = any ? 1u : 0u; }
};

struct ThreadClosest : Kernel {
  Bvh8View tree;
  const DeviceRay* rays;
  Hit* hits;
  OCTRAD_HD void operator()(std::uint32_t i) const {
    hits[i] = bvh8_intersect(tree, rays[i].origin, rays[i].direction, 0.0f, rays[i].t_max);
  }
};

struct ThreadOccluded : Kernel {
  Bvh8View tree;
  const DeviceRay* rays;
  std::uint32_t* blocked;
  OCTRAD_HD void operator()(std::uint32_t i) const {
    blocked[i] = bvh8_occluded(tree, rays[i].origin, rays[i].direction, 0.0f, rays[i].t_max) ? 1u : 0u;
  }
};

}  // namespace

RayBatch::RayBatch(Stream& stream, const PreparedScene& scene, std::span<const RayQuery> rays)
    : stream_(&stream),
      tree_(scene.world(stream).bvh),
      rays_(stream, rays.size(), "rays") {
  std::vector<DeviceRay> host(rays.size());
  for (std::size_t i = 0; i < rays.size(); ++i) host[i] = {rays[i].origin, rays[i].t_max, rays[i].direction, 0.0f};
  rays_.upload(host);
}

void RayBatch::closest(Traversal traversal, Hit* hits) const {
  const auto n = static_cast<std::uint32_t>(rays_.size());
  if (traversal == Traversal::warps) cast(*stream_, n, WarpRays<false, Hit>{{}, tree_, n, rays_.data(), hits});
  else launch(*stream_, n, ThreadClosest{{}, tree_, rays_.data(), hits});
}

void RayBatch::occluded(Traversal traversal, std::uint32_t* blocked) const {
  const auto n = static_cast<std::uint32_t>(rays_.size());
  if (traversal == Traversal::warps)
    cast(*stream_, n, WarpRays<true, std::uint32_t>{{}, tree_, n, rays_.data(), blocked});
  else launch(*stream_, n, ThreadOccluded{{}, tree_, rays_.data(), blocked});
}

std::vector<RayQuery> incoherent_rays(const PreparedScene& scene, std::size_t n, bool finite, std::uint64_t seed) {
  const SurfaceSampler& sampler = scene.surfaces();
  const float size = length(scene.scene().bounds.extent());
  std::vector<RayQuery> rays(n);
  for (std::size_t i = 0; i < n; ++i) {
    Rng rng(seed, RngPurpose::test, i);
    const float pick = rng.uniform();
    const SurfaceInteraction s = sampler.sample(pick, rng.uniform2());
    const Vec3f d = uniform_direction(rng.uniform2());
    rays[i] = {offset_origin(s.position, s.geometric_normal, d), d, finite ? 0.5f * size * rng.uniform() : 1e30f};
  }
  return rays;
}

std::vector<RayQuery> training_rays(const PreparedScene& scene, std::size_t n, bool finite, std::uint64_t seed) {
  constexpr int kTries = 16;
  const std::vector<RayQuery> first = incoherent_rays(scene, n, false, seed);
  const TransportContext context = scene.context();
  const float size = length(scene.scene().bounds.extent());
  std::vector<RayQuery> rays(n);
  parallel_for(n, [&](std::size_t i) {
    Rng rng(seed, RngPurpose::test, n + i);
    RayQuery from = first[i];
    rays[i] = from;
    for (int k = 0; k < kTries; ++k) {
      const Hit hit = context.intersect(from.origin, from.direction, 0.0f, kRayInfinity);
      if (hit.valid()) {
        const SurfaceInteraction s = context.interact(hit, from.origin, from.direction);
        const Vec3f n_seen = dot(s.geometric_normal, from.direction) > 0.0f ? -s.geometric_normal : s.geometric_normal;
        const Vec3f d = make_frame(n_seen).to_world(square_to_cosine_hemisphere(rng.uniform2()));
        rays[i] = {offset_origin(s.position, s.geometric_normal, d), d,
                   finite ? 0.5f * size * rng.uniform() : kRayInfinity};
        return;
      }
      from = first[static_cast<std::size_t>(rng.uniform() * static_cast<float>(n - 1))];
    }
  });
  return rays;
}

CheckResult check_closest(Stream& stream, const PreparedScene& scene, std::span<const RayQuery> rays,
                          RayBatch::Traversal traversal, const Tracer* other) {
  const DeviceArray<Hit> hits(stream, rays.size(), "check");
  RayBatch(stream, scene, rays).closest(traversal, hits.data());
  const std::vector<Hit> found = hits.download();
  std::vector<Hit> expected(rays.size());
  const Bvh8View tree = scene.bvh8().view();
  parallel_for(rays.size(), [&](std::size_t i) {
    const RayQuery& r = rays[i];
    expected[i] = other != nullptr ? other->intersect(r.origin, r.direction, 0.0f, r.t_max)
                                   : bvh8_intersect(tree, r.origin, r.direction, 0.0f, r.t_max);
  });
  CheckErrors errors;
  bool same = true;
  for (std::size_t i = 0; i < rays.size(); ++i) {
    const Hit &a = found[i], &b = expected[i];
    if (a.valid() != b.valid()) errors.add(std::numeric_limits<double>::infinity());
    else errors.add(a.valid() ? std::fabs(static_cast<double>(a.t) - b.t) / std::fmax(1e-20, b.t) : 0.0);
    same = same && std::memcmp(&a, &b, sizeof(Hit)) == 0;
  }
  // Other trees decide otherwise about edges.
  if (other != nullptr) return errors.result("relative error of t", 1e-4, 1e-4);
  CheckResult r = errors.exact_on_host(stream, "relative error of t", 1e-6, 1e-5);
  r.require(same || stream.on_device(), "other surfaces");
  return r;
}

CheckResult check_occluded(Stream& stream, const PreparedScene& scene, std::span<const RayQuery> rays,
                           RayBatch::Traversal traversal, const Tracer* other) {
  const DeviceArray<std::uint32_t> blocked(stream, rays.size(), "check");
  RayBatch(stream, scene, rays).occluded(traversal, blocked.data());
  std::vector<std::uint32_t> expected(rays.size());
  const Bvh8View tree = scene.bvh8().view();
  parallel_for(rays.size(), [&](std::size_t i) {
    const RayQuery& r = rays[i];
    expected[i] = other != nullptr ? other->occluded(r.origin, r.direction, 0.0f, r.t_max)
                                   : bvh8_occluded(tree, r.origin, r.direction, 0.0f, r.t_max);
  });
  CheckErrors errors;
  errors.compare_words(blocked.download(), expected);
  // Edges, and lengths that end on a surface, may be decided differently.
  return other != nullptr ? errors.result("other answers than Embree", 0.0, 1e-4)
                          : errors.exact_on_host(stream, "other answers than the CPU", 0.0, 1e-5);
}

}  // namespace octrad
