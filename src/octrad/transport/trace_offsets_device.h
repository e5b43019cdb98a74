// Rays along the look-up directions of queries on a device (lookup.offset = traced): disparities, and what is seen
// there. For files named *_device.cc.
#pragma once

#include "octrad/base/query_rays.h"
#include "octrad/device/launch.h"
#include "octrad/shading/device_world.h"
#include "octrad/transport/follow_math.h"
#include "octrad/transport/queue_math.h"

namespace octrad {

// The ray of `offset` from point `i`, and what it fills in. Where the ray has a direction of its own it is there
// already.
OCTRAD_HD_OR_HOST
template <typename World>
OCTRAD_HD inline void trace_offset_at(const World& world, const OffsetRay& offset, const SurfacePointArray& points,
                                      std::uint32_t i, Vec3f geometric_normal) {
  SurfacePoint point = points.load(i);
  trace_offset(world, offset, geometric_normal, point,
               draws_offset_direction(offset, point) ? points.reflected.direction(i) : Vec3f(0.0f));
  points.set(kDisparityNumber, i, point.disparity);
  if (offset.reflected) points.reflected.set(i, point.reflected);
}

// A ray for each query whose look-up has an offset.
template <typename World>
struct TraceOffsets : Kernel {
  static constexpr unsigned kMinBlocks = 5;  // 96 registers: in a plain world nothing spills
  World world;
  OffsetRay offset;
  SurfacePointArray queries;
  FloatPlanes normals;         // geometric, of the queries
  const std::uint32_t* count;  // of queries
  unsigned long long* rays;    // those traced are added

  OCTRAD_HD void operator()(std::uint32_t q) const {
    if (q >= *count) return;
    if (offset.rule.has_offset(queries.get(kAlphaNumber, q))) atomic_add(rays, 1ull);
    trace_offset_at(world, offset, queries, q, normals.get3(0, q));
  }
};

// Traces those of at most `most` queries, where a look-up takes a traced one.
inline void trace_offsets(Stream& stream, std::size_t most, const DeviceWorld& world, const OffsetRay& offset,
                          SurfacePointArray queries, FloatPlanes normals, const std::uint32_t* count,
                          unsigned long long* rays) {
  if (!offset.traced) return;
  with_world(world, [&](const auto& of_kind) {
    launch(stream, most,
           TraceOffsets<std::decay_t<decltype(of_kind)>>{{}, of_kind, offset, queries, normals, count, rays});
  });
}

}  // namespace octrad
