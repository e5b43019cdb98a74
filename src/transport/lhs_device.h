// Left-hand-side points (transport/lhs_sampler.h) on a Stream.
#pragma once

#include <span>

#include "base/surface_point.h"
#include "transport/device_memory.h"
#include "transport/lhs_math.h"

namespace octrad {

struct DeviceWorld;

// Draws the points that LhsSampler draws. `World` also has sample_surface().
template <typename World>
class LhsOn {
 public:
  // `views`, `fresh_poses`: of a LhsSampler. For batches of up to `capacity` points.
  LhsOn(Stream& stream, const World& world, const LhsOptions& options, std::span<const CameraView> views, bool fresh_poses, std::size_t capacity);

  // Points 0 .. n - 1 of step *step (device memory). Can be recorded. `traced_disparity`: fill SurfacePoint::disparity.
  void run(const unsigned long long* step, std::size_t n, bool traced_disparity = false);
  const ShadingPoint* points() const { return points_.data(); }
  SurfacePointArray surface_points() const { return surface_points_.points(); }

  // How many points could not be drawn since the last call (no_lhs_point()): what is in their places is of no use.
  unsigned long long take_missing();
  std::size_t capacity() const { return capacity_; }
  static std::size_t bytes(std::size_t capacity);

 private:
  Stream* stream_;
  World world_;
  LhsOptions options_;
  std::size_t capacity_;
  bool fresh_poses_;
  DeviceArray<CameraView> views_;
  DeviceArray<unsigned long long> missing_;
  DeviceArray<ShadingPoint> points_;
  PlaneArray surface_points_;
};

using DeviceLhs = LhsOn<DeviceWorld>;

}  // namespace octrad
