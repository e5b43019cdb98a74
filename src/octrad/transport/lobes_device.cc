// Kernels and driver of DeviceLobes. Glossy points are listed; of some of the list at a time, item j, ray m is slot
// j * M + m, and its distance is at m * G + j, G being the number of items.
#include "octrad/transport/lobes_device.h"

#include <algorithm>

#include "octrad/device/launch.h"
#include "octrad/transport/cast.h"
#include "octrad/transport/hit_clusters_math.h"
#include "octrad/transport/lobe_math.h"

namespace octrad {
namespace lobe_kernels {

// Random numbers of left-hand-side points.
struct Seed : Kernel {
  unsigned long long seed;
  const unsigned long long* step;
  SobolSet* samples;
  OCTRAD_HD void operator()(std::uint32_t i) const {
    Rng rng = lobe_generator(seed, *step, i);
    samples[i] = SobolSet(rng);
  }
};

// Lists the points that want rays; the others have no clusters.
struct Choose : Kernel {
  SurfacePointArray points;
  const std::uint32_t* count;  // null: all
  QueryRays rays;
  HitClusterArray clusters;
  std::uint32_t* list;
  std::uint32_t* size;
  OCTRAD_HD void operator()(std::uint32_t i) const {
    if (count != nullptr && i >= *count) return;
    if (rays.lobe_rays(points.get(kAlphaNumber, i)) > 0) {
      list[atomic_append(size)] = i;
      return;
    }
    OCTRAD_UNROLL
    for (int k = 0; k < kHitClusters; ++k) clusters.set(k, i, {});
  }
};

// The part of the list that is looked at: items first, ..., as many as there are.
struct Part {
  const std::uint32_t* list;
  const std::uint32_t* size;
  std::uint32_t first;
  OCTRAD_HD bool holds(std::uint32_t j) const { return first + j < *size; }
  OCTRAD_HD std::uint32_t point(std::uint32_t j) const { return list[first + j]; }
};

// The surfaces of queries once more.
template <typename World>
struct Shade : Kernel {
  static constexpr unsigned kMinBlocks = 4;
  World world;
  Part part;
  const FarEnd* ends;
  ShadingPoint* shaded;
  OCTRAD_HD void operator()(std::uint32_t j) const {
    if (part.holds(j)) shaded[j] = shade_far_end(world, ends[part.point(j)]);
  }
};

// Rays in flight.
struct Rays {
  RayPlanes queue;
  std::uint32_t* owners;  // slots
  std::uint32_t* size;
  float* distances;           // below 0: met nothing
  std::uint32_t each, items;  // M, G

  OCTRAD_HD float& distance(std::uint32_t j, std::uint32_t m) const {
    return distances[static_cast<std::size_t>(m) * items + j];
  }
};

template <typename World>
struct Draw : Kernel {
  Part part;
  const ShadingPoint* shaded;  // by item
  const ShadingPoint* points;  // by point; one of the two is null
  const SobolSet* samples;
  Rays rays;
  OCTRAD_HD void operator()(std::uint32_t slot) const {
    const std::uint32_t j = slot / rays.each, m = slot - j * rays.each;
    if (!part.holds(j)) return;
    const std::uint32_t i = part.point(j);
    const ShadingPoint point = points != nullptr ? points[i] : shaded[j];
    rays.distance(j, m) = -1.0f;
    RayQuery ray;
    bool delta = false;
    if (!lobe_ray<World::kModels>(point, point.to_local(point.wo), samples[i](m), ray, delta)) return;
    const std::uint32_t place = atomic_append(rays.size);
    rays.queue.store(place, ray);
    rays.owners[place] = slot;
  }
};

struct Extend : Kernel {
  DeviceWorld world;
  Rays rays;
  static constexpr bool kAny = false;
  OCTRAD_HD Bvh8View bvh() const { return world.bvh; }
  OCTRAD_HD std::uint32_t size() const { return *rays.size; }
  OCTRAD_HD void count() const {}
  OCTRAD_HD RayQuery ray(std::uint32_t q) const { return rays.queue.load(q); }
  OCTRAD_HD void met(std::uint32_t q, const Hit& hit) const {
    const std::uint32_t slot = rays.owners[q], j = slot / rays.each;
    if (hit.valid()) rays.distance(j, slot - j * rays.each) = hit.t;
  }
};

struct Column {
  float* data;
  std::size_t stride;
  OCTRAD_HD float& operator[](int i) const { return data[static_cast<std::size_t>(i) * stride]; }
};

struct Cluster : Kernel {
  Part part;
  Rays rays;
  QueryRays wanted;
  HitClusterArray clusters;
  unsigned long long* counted;  // may be null
  OCTRAD_HD void operator()(std::uint32_t j) const {
    if (counted != nullptr && part.first == 0 && j == 0)
      *counted += static_cast<unsigned long long>(*part.size) * rays.each;
    if (!part.holds(j)) return;
    const Column t{&rays.distance(j, 0), rays.items};
    int met = 0;
    for (std::uint32_t m = 0; m < rays.each; ++m) {
      const float distance = rays.distance(j, m);
      if (distance >= 0.0f) t[met++] = distance;
    }
    HitCluster found[kHitClusters];
    cluster_hits(t, met, static_cast<int>(rays.each), wanted.clusters, wanted.iterations, found);
    OCTRAD_UNROLL
    for (int k = 0; k < kHitClusters; ++k) clusters.set(k, part.point(j), found[k]);
  }
};

std::size_t items_at_once(std::size_t capacity, const QueryRays& rays, std::size_t rays_in_flight) {
  return std::clamp<std::size_t>(rays_in_flight / static_cast<std::size_t>(rays.lobe), 1,
                                 std::max<std::size_t>(capacity, 1));
}

}  // namespace lobe_kernels

DeviceLobes::DeviceLobes(Stream& stream, const DeviceWorld& world, std::size_t capacity, const QueryRays& rays,
                         bool queries, std::size_t rays_in_flight) {
  if (rays.lobe == 0 || capacity == 0) return;
  const std::string points = "points that cones start from", cones = "rays of cones";
  stream_ = &stream;
  world_ = world;
  rays_ = rays;
  capacity_ = capacity;
  at_once_ = lobe_kernels::items_at_once(capacity, rays, rays_in_flight);
  const std::size_t slots = at_once_ * static_cast<std::size_t>(rays.lobe);
  if (queries) ends_ = DeviceArray<FarEnd>(stream, capacity, points);
  samples_ = DeviceArray<SobolSet>(stream, capacity, points);
  if (queries) shaded_ = DeviceArray<ShadingPoint>(stream, at_once_, points);
  glossy_ = DeviceArray<std::uint32_t>(stream, capacity, points);
  sizes_ = DeviceArray<std::uint32_t>(stream, 1 + (capacity + at_once_ - 1) / at_once_, points);
  owners_ = DeviceArray<std::uint32_t>(stream, slots, cones);
  distances_ = DeviceArray<float>(stream, slots, cones);
  ray_queue_ = PlaneArray(stream, kRayNumbers, slots, cones);
  clusters_ = PlaneArray(stream, kHitClusterNumbers, capacity, "clusters of hits");
}

std::size_t DeviceLobes::bytes(std::size_t capacity, const QueryRays& rays, bool queries) {
  if (rays.lobe == 0) return 0;
  const std::size_t items = lobe_kernels::items_at_once(capacity, rays, kRaysInFlight),
                    slots = items * static_cast<std::size_t>(rays.lobe);
  return capacity * ((queries ? sizeof(FarEnd) : 0) + sizeof(SobolSet) + sizeof(std::uint32_t) +
                     static_cast<std::size_t>(kHitClusterNumbers) * sizeof(float)) +
         (queries ? items * sizeof(ShadingPoint) : 0) +
         slots * (sizeof(std::uint32_t) + static_cast<std::size_t>(kRayNumbers + 1) * sizeof(float));
}

void DeviceLobes::trace(SurfacePointArray points, const std::uint32_t* count, std::size_t n, TraceCounts* counts) {
  run(points, count, nullptr, n, counts);
}

void DeviceLobes::trace(SurfacePointArray points, const ShadingPoint* shading, unsigned long long seed,
                        const unsigned long long* step, std::size_t n) {
  using namespace lobe_kernels;
  if (empty()) return;
  launch(*stream_, n, Seed{{}, seed, step, samples_.data()});
  run(points, nullptr, shading, n, nullptr);
}

void DeviceLobes::run(SurfacePointArray points, const std::uint32_t* count, const ShadingPoint* shading, std::size_t n,
                      TraceCounts* counts) {
  using namespace lobe_kernels;
  if (empty() || n == 0) return;
  if (n > capacity_) throw DeviceError("rays of cones for more points than there is memory for");
  const auto each = static_cast<std::uint32_t>(rays_.lobe), items = static_cast<std::uint32_t>(at_once_);
  sizes_.fill(0);
  launch(*stream_, n, Choose{{}, points, count, rays_, clusters(), glossy_.data(), sizes_.data()});
  std::uint32_t* ray_count = sizes_.data();
  for (std::size_t first = 0; first < n; first += at_once_) {
    const std::size_t some = std::min(at_once_, n - first), slots = some * each;
    const Part part{glossy_.data(), sizes_.data(), static_cast<std::uint32_t>(first)};
    const Rays rays{ray_queue_.rays(), owners_.data(), ++ray_count, distances_.data(), each, items};
    with_world(world_, [&](const auto& world) {
      using World = std::decay_t<decltype(world)>;
      if (shading == nullptr) launch(*stream_, some, Shade<World>{{}, world, part, ends_.data(), shaded_.data()});
      launch(*stream_, slots,
             Draw<World>{{}, part, shading == nullptr ? shaded_.data() : nullptr, shading, samples_.data(), rays});
    });
    cast(*stream_, slots, Extend{{}, world_, rays});
    launch(*stream_, some, Cluster{{}, part, rays, rays_, clusters(), counts != nullptr ? &counts->rays : nullptr});
  }
}

}  // namespace octrad
