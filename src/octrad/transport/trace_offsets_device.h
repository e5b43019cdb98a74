// Disparities of queries on a device (lookup.offset = traced). For files named *_device.cc.
#pragma once

#include "octrad/device/launch.h"
#include "octrad/shading/device_world.h"
#include "octrad/transport/follow_math.h"
#include "octrad/transport/queue_math.h"

namespace octrad {

// A ray for each query whose look-up has an offset.
struct TraceOffsets : Kernel {
  DeviceWorld world;
  LookupRule rule;
  SurfacePointArray queries;
  FloatPlanes normals;         // geometric, of the queries
  const std::uint32_t* count;  // of queries
  unsigned long long* rays;    // those traced are added

  OCTRAD_HD void operator()(std::uint32_t q) const {
    if (q >= *count) return;
    const SurfacePoint point = queries.load(q);
    if (rule.has_offset(point.alpha)) atomic_add(rays, 1ull);
    queries.set(kDisparityNumber, q, traced_disparity(world, rule, point, normals.get3(0, q)));
  }
};

// Traces those of at most `most` queries, where a look-up takes a traced one.
inline void trace_offsets(Stream& stream, std::size_t most, const DeviceWorld& world, const OffsetRay& offset,
                          SurfacePointArray queries, FloatPlanes normals, const std::uint32_t* count,
                          unsigned long long* rays) {
  if (offset.traced) launch(stream, most, TraceOffsets{{}, world, offset.rule, queries, normals, count, rays});
}

}  // namespace octrad
