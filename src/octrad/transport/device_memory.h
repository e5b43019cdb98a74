// Device arrays behind the planes of transport/queue_math.h.
#pragma once

#include <string>

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
  std::size_t stride() const { return stride_; }
  const DeviceArray<float>& memory() const { return memory_; }

 private:
  std::size_t stride_ = 0;
  DeviceArray<float> memory_;
};

// What was counted since the last call.
inline TraceCounts take_counts(DeviceArray<TraceCounts>& counts) {
  const TraceCounts taken = counts.download()[0];
  counts.fill(0);
  return taken;
}

}  // namespace octrad
