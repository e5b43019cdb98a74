// The right-hand side of transport/rhs_estimator.h on a Stream: all directions of all points at once.
#pragma once

#include "octrad/base/follow_rules.h"
#include "octrad/base/query_rays.h"
#include "octrad/base/surface_point.h"
#include "octrad/shading/device_world.h"
#include "octrad/transport/device_memory.h"
#include "octrad/transport/direction_guide_math.h"
#include "octrad/transport/far_ends_math.h"
#include "octrad/transport/lobes_device.h"
#include "octrad/transport/rhs_math.h"

namespace octrad {
namespace rhs_kernels {
struct Memory;
}

struct DeviceRhsOptions : FollowRules {
  DeviceRhsOptions() : FollowRules{.follow_below = kFollowDelta} {}
  explicit DeviceRhsOptions(const FollowRules& rules) : FollowRules(rules) {}
  int directions = 16;        // M
  bool own_emission = false;  // add the points' own emission to the targets
  bool ask = true;            // false: a black cache (direct light and chains only); there are no queries then
  unsigned long long seed = 0;
  GuideView guides;                // in device memory: directions are drawn from it as well, and it learns from them
  const float* epsilon = nullptr;  // of the loss, for what is learnt; in device memory
  FarEnd* far_ends = nullptr;      // device memory: filled by reduce() for the points of far_end_range()
  std::uint32_t far_end_count = 0;
};

// Points to estimate at, in device memory.
struct DeviceRhsPoints {
  const ShadingPoint* points = nullptr;
  const std::uint32_t* count = nullptr;  // how many of the `most` there are; null: all
  std::size_t most = 0;
  const unsigned long long* stream = nullptr;  // e.g. the step: streams never share random numbers; null: stream 0
  const unsigned long long* keys = nullptr;    // of the camera samples that saw the points; null: none did
};

// Two parts with the queries of the cache between them: trace() fills queries(), reduce() sums up each point's targets
// in the order of the CPU, which estimates the same. Everything is allocated by the constructor; both can be recorded.
class DeviceRhs {
 public:
  // For up to `slots` points times directions. `rays`: what is traced from the queries. `guided`: options may have
  // guides.
  DeviceRhs(Stream& stream, const DeviceWorld& world, std::size_t slots, const QueryRays& rays = {},
            bool guided = false);

  void trace(const DeviceRhsPoints& points, const DeviceRhsOptions& options);
  SurfacePointArray queries() const {
    SurfacePointArray queries = queries_.points(query_rays_.offset);
    queries.lobe = lobes_.clusters();
    return queries;
  }
  const std::uint32_t* query_count() const { return sizes_.data() + kQueries; }  // at most capacity()
  // responses[q] for query q; may be null where there are no queries. Needs the points and options of the last trace().
  void reduce(const DeviceRhsPoints& points, const DeviceRhsOptions& options, const Vec3f* responses, Vec3f* targets);

  std::size_t capacity() const { return capacity_; }
  // Since the last call.
  TraceCounts take_counts();
  static std::size_t bytes(std::size_t slots, const QueryRays& rays, bool guided = false);

 private:
  enum { kShadows, kRays, kChains, kQueries, kShadowsTaken, kRaysTaken, kSizes };
  rhs_kernels::Memory memory() const;

  Stream* stream_;
  DeviceWorld world_;
  std::size_t capacity_;
  QueryRays query_rays_;
  DeviceArray<TraceCounts> counts_;
  DeviceArray<std::uint32_t> sizes_, owners_, shadow_owners_, chains_, query_of_, places_, cells_;
  DeviceArray<Hit> hits_;
  PlaneArray rays_, shadow_rays_, slots_, queries_, normals_, guide_numbers_;
  DeviceLobes lobes_;
};

}  // namespace octrad
