// What a field wants traced from many points' BSDF lobes (QueryRays::lobe), on a Stream: rays, and the clusters of
// their distances, as field_query_point() (transport/query_point.h) finds them on the CPU.
#pragma once

#include "octrad/base/hit_cluster.h"
#include "octrad/base/query_rays.h"
#include "octrad/base/sobol_math.h"
#include "octrad/base/surface_point.h"
#include "octrad/shading/device_world.h"
#include "octrad/transport/device_memory.h"
#include "octrad/transport/far_ends_math.h"
#include "octrad/transport/follow_math.h"

namespace octrad {

// What must be known of a query to draw its rays, stored by the kernel that makes the query: the ray that it ended,
// from which its surface is shaded again, and its random numbers. Null where no field wants rays.
struct LobeStarts {
  FarEnd* ends = nullptr;
  SobolSet* samples = nullptr;

  OCTRAD_HD void store(std::uint32_t q, const Segment& segment, const Hit& hit, Lobe lobe, Rng& rng) const {
    if (ends == nullptr) return;
    ends[q] = {segment.origin, segment.direction, hit, lobe};
    samples[q] = SobolSet(rng);
  }
};

// Everything is allocated by the constructor; trace() can be recorded. Rays are cast for some of the points at a time.
class DeviceLobes {
 public:
  DeviceLobes() = default;                                            // traces nothing
  static constexpr std::size_t kRaysInFlight = std::size_t{1} << 22;  // keeps any device busy
  // For up to `capacity` points. `queries`: the points are queries with starts(), else those of training.
  DeviceLobes(Stream& stream, const DeviceWorld& world, std::size_t capacity, const QueryRays& rays, bool queries,
              std::size_t rays_in_flight = kRaysInFlight);
  // What the constructor allocates: nothing where no rays are wanted.
  static std::size_t bytes(std::size_t capacity, const QueryRays& rays, bool queries);

  bool empty() const { return capacity_ == 0; }
  LobeStarts starts() const { return {ends_.data(), samples_.data()}; }
  HitClusterArray clusters() const { return {clusters_.planes().data, clusters_.stride()}; }

  // Clusters of queries 0 .. min(*count, n) - 1. Adds to counts->rays, as many as QueryRays::count() says.
  void trace(SurfacePointArray points, const std::uint32_t* count, std::size_t n, TraceCounts* counts);
  // Clusters of the n left-hand-side points of step *step, with the random numbers of lobe_generator().
  void trace(SurfacePointArray points, const ShadingPoint* shading, unsigned long long seed,
             const unsigned long long* step, std::size_t n);

 private:
  void run(SurfacePointArray points, const std::uint32_t* count, const ShadingPoint* shading, std::size_t n,
           TraceCounts* counts);

  Stream* stream_ = nullptr;
  DeviceWorld world_;
  QueryRays rays_;
  std::size_t capacity_ = 0, at_once_ = 0;  // points whose rays are in flight together
  DeviceArray<FarEnd> ends_;
  DeviceArray<SobolSet> samples_;
  DeviceArray<ShadingPoint> shaded_;
  DeviceArray<std::uint32_t> glossy_, sizes_, owners_;
  DeviceArray<float> distances_;
  PlaneArray ray_queue_, clusters_;
};

}  // namespace octrad
