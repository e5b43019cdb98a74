// Kernels and driver of LhsOn, for files named *_device.cc.
#pragma once

#include "base/error.h"
#include "device/launch.h"
#include "transport/lhs_device.h"

namespace octrad {
namespace lhs_kernels {

template <typename World>
struct Draw : Kernel {
  World world;
  LhsOptions options;
  LhsPoses poses;
  const unsigned long long* step;
  ShadingPoint* points;
  SurfacePointArray surface_points;
  unsigned long long* missing;
  OCTRAD_HD void operator()(std::uint32_t i) const {
    ShadingPoint point;
    if (!lhs_point(world, options, poses, *step, i, point)) atomic_add(missing, 1ull);
    points[i] = point;
    surface_points.store(i, surface_point(point));
  }
};

template <typename World>
struct Disparity : Kernel {
  World world;
  const ShadingPoint* points;
  SurfacePointArray surface_points;
  OCTRAD_HD void operator()(std::uint32_t i) const {
    const float disparity = traced_disparity(world, surface_points.load(i), points[i].surface.geometric_normal);
    surface_points.data[static_cast<std::size_t>(kSurfacePointNumbers - 1) * surface_points.stride + i] = disparity;
  }
};

}  // namespace lhs_kernels

template <typename World>
LhsOn<World>::LhsOn(Stream& stream, const World& world, const LhsOptions& options, std::span<const CameraView> views, bool fresh_poses, std::size_t capacity)
    : stream_(&stream), world_(world), options_(options), capacity_(capacity), fresh_poses_(fresh_poses), views_(stream, views, "camera poses"),
      missing_(stream, 1, "counts of points"), points_(stream, capacity, "left-hand-side points"),
      surface_points_(stream, kSurfacePointNumbers, capacity, "left-hand-side points") {
  if (views.empty()) throw UsageError("left-hand-side points need a camera to start from");
  missing_.fill(0);
}

template <typename World>
std::size_t LhsOn<World>::bytes(std::size_t capacity) {
  return capacity * (sizeof(ShadingPoint) + static_cast<std::size_t>(kSurfacePointNumbers) * sizeof(float));
}

template <typename World>
void LhsOn<World>::run(const unsigned long long* step, std::size_t n, bool traced) {
  using namespace lhs_kernels;
  if (n > capacity_) throw UsageError(std::to_string(n) + " left-hand-side points: memory was taken for " + std::to_string(capacity_));
  const LhsPoses poses{views_.data(), static_cast<std::uint32_t>(views_.size()), fresh_poses_};
  launch(*stream_, n, Draw<World>{{}, world_, options_, poses, step, points_.data(), surface_points_.points(), missing_.data()});
  if (traced) launch(*stream_, n, Disparity<World>{{}, world_, points_.data(), surface_points_.points()});
}

template <typename World>
unsigned long long LhsOn<World>::take_missing() {
  const unsigned long long missing = missing_.download()[0];
  missing_.fill(0);
  return missing;
}

}  // namespace octrad
