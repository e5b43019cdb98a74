// Device arrays behind the planes of transport/queue_math.h.
#pragma once

#include <string>
#include <vector>

#include "octrad/base/hit_cluster.h"
#include "octrad/base/query_rays.h"
#include "octrad/base/reflected_surface.h"
#include "octrad/base/surface_point.h"
#include "octrad/device/array.h"
#include "octrad/transport/queue_math.h"

namespace octrad {

// `numbers` floats for each of `size` items.
class PlaneArray {
 public:
  PlaneArray() = default;
  PlaneArray(Stream& stream, int numbers, std::size_t size, const std::string& what)
      : stride_((size + 31) / 32 * 32),
        memory_(stream, static_cast<std::size_t>(numbers) * ((size + 31) / 32 * 32), what) {}
  FloatPlanes planes() const { return {memory_.data(), stride_}; }
  RayPlanes rays() const { return {planes()}; }
  SurfacePointArray points() const { return {memory_.data(), stride_}; }
  // With what the ray of `offset` shows, if it says so: as many numbers as surface_point_numbers(offset).
  SurfacePointArray points(const OffsetRay& offset) const {
    QueryRays rays;
    rays.offset = offset;
    return surface_point_array(memory_.data(), stride_, rays);
  }
  std::size_t stride() const { return stride_; }
  const DeviceArray<float>& memory() const { return memory_; }

 private:
  std::size_t stride_ = 0;
  DeviceArray<float> memory_;
};

// Points 0 .. n - 1 of arrays in a stream's memory.
inline std::vector<SurfacePoint> download_points(Stream& stream, const SurfacePointArray& points, std::size_t n) {
  const auto planes = [&](const float* data, std::size_t numbers, std::size_t stride) {
    std::vector<float> values(data != nullptr ? numbers * stride : 0);
    if (!values.empty()) stream.download(values.data(), data, values.size() * sizeof(float));
    return values;
  };
  std::vector<float> numbers = planes(points.data, kSurfacePointNumbers, points.stride),
                     reflected = planes(points.reflected.data, ReflectedArray::kNumbers, points.reflected.stride),
                     clusters = planes(points.lobe.data, kHitClusterNumbers, points.lobe.stride);
  SurfacePointArray host{numbers.data(), points.stride};
  if (!clusters.empty()) host.lobe = {clusters.data(), points.lobe.stride};
  if (!reflected.empty()) host.reflected = {reflected.data(), points.reflected.stride};
  std::vector<SurfacePoint> result(n);
  for (std::size_t i = 0; i < n; ++i) result[i] = host.load_all(i);
  return result;
}

// What was counted since the last call.
inline TraceCounts take_counts(DeviceArray<TraceCounts>& counts) {
  const TraceCounts taken = counts.download()[0];
  counts.fill(0);
  return taken;
}

}  // namespace octrad
