// Left-hand-side points (transport/lhs_sampler.h) on a Stream.
#pragma once

#include <span>

#include "octrad/base/query_rays.h"
#include "octrad/base/surface_point.h"
#include "octrad/shading/device_world.h"
#include "octrad/transport/device_memory.h"
#include "octrad/transport/far_ends_math.h"
#include "octrad/transport/lhs_math.h"

namespace octrad {

// Draws the points that LhsSampler draws. They do not depend on the field: those of several steps are drawn together,
// since a few of many points take far longer than the rest. Steps form groups for that: of `steps` steps,
// group g is steps g * steps, ..., (g + 1) * steps - 1.
class DeviceLhs {
 public:
  // `views`, `fresh_poses`: of a LhsSampler. For up to `most` points a step, and `most_ahead` (or `most`, if that is
  // more) of all steps of a group. `rounds`: rays that are traced for all points as a wavefront, before the few points
  // that need more are finished by one thread each; below 0: 12, or 32 where rough points are rejected, so that a few
  // per cent are left in the usual scenes. `drawing`: a sibling on which draw() runs, so that a group is drawn while
  // another one is taken from; there are two buffers then. `offset`: the ray of trace_offset() from each point. Throws
  // UsageError without a view, or for walks of more than 255 vertices.
  DeviceLhs(Stream& stream, const DeviceWorld& world, const LhsOptions& options, std::span<const CameraView> views,
            bool fresh_poses, std::size_t most, std::size_t most_ahead = 0, int rounds = -1, Stream* drawing = nullptr,
            const OffsetRay& offset = {});

  // Draws points 0 .. n - 1 of every step of the group of step *step (device memory), *by_area (too; null: 1) as of
  // LhsSampler::sample(). Can be recorded, as can the others.
  void draw(const unsigned long long* step, std::size_t n, int steps, int buffer = 0, const double* by_area = nullptr);
  // Makes those of step *step the current points. Its group must have been drawn with the same n and steps.
  void take(const unsigned long long* step, std::size_t n, int steps, int buffer = 0);
  // The first `count` current points become these far ends, where there is one.
  void take_far_ends(const FarEnd* far_ends, std::size_t count);
  // Both for a step alone.
  void run(const unsigned long long* step, std::size_t n) {
    draw(step, n, 1);
    take(step, n, 1);
  }
  const ShadingPoint* points() const { return points_.data(); }
  SurfacePointArray surface_points() const { return surface_points_.points(offset_); }

  // Number of points taken since the last call that could not be drawn (no_lhs_point()); their values are invalid.
  unsigned long long take_missing();
  static std::size_t bytes(std::size_t most, std::size_t most_ahead, int buffers = 1, const OffsetRay& offset = {});

 private:
  void check(std::size_t n, int steps) const;

  Stream* stream_;
  Stream* drawing_;
  DeviceWorld world_;
  LhsOptions options_;
  OffsetRay offset_;
  std::size_t most_, most_ahead_;
  int rounds_;
  bool fresh_poses_;
  DeviceArray<CameraView> views_;
  DeviceArray<unsigned long long> missing_;
  DeviceArray<std::uint32_t> sizes_, queues_[2], progress_;
  DeviceArray<Rng> generators_;
  DeviceArray<Hit> hits_;
  PlaneArray walks_;
  DeviceArray<ShadingPoint> drawn_[2], points_;
  PlaneArray drawn_surface_points_[2], surface_points_;
};

}  // namespace octrad
