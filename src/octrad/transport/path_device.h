// The path tracer of transport/path.h on a Stream, one kernel for each part of a step (Laine, Karras & Aila 2013,
// "Megakernels Considered Harmful"): the same paths from the same random numbers as trace_paths() with a tracer of one
// ray at a time.
#pragma once

#include "octrad/shading/device_world.h"
#include "octrad/transport/camera_job.h"
#include "octrad/transport/device_memory.h"
#include "octrad/transport/path_math.h"

namespace octrad {

// Everything is allocated by the constructor; run() can be recorded.
class DevicePathTracer {
 public:
  // For jobs of up to `capacity` samples. Paths longer than `wave_bounces` are finished by one thread each.
  DevicePathTracer(Stream& stream, const DeviceWorld& world, std::size_t capacity, int wave_bounces = 16);

  // What the next run() traces; not while the stream records.
  void set(const CameraJob& job);
  // Traces the job's samples. A recorded run keeps its limits and serves jobs of at most `samples` samples (0: the
  // capacity).
  void run(const PathLimits& limits, std::size_t samples = 0);

  std::size_t capacity() const { return capacity_; }
  const CameraJob* job() const { return job_.data(); }          // device memory
  SamplePlanes samples() const { return {samples_.planes()}; }  // of the job, in device memory
  // Rays since the last call.
  unsigned long long take_rays();
  static std::size_t bytes(std::size_t capacity);

 private:
  Stream* stream_;
  DeviceWorld world_;
  std::size_t capacity_;
  int wave_bounces_;
  DeviceArray<CameraJob> job_;
  DeviceArray<TraceCounts> counts_;
  DeviceArray<std::uint32_t> sizes_, queue_[2], valid_, shadow_owner_;
  DeviceArray<Rng> generators_;
  DeviceArray<Hit> hits_;
  PlaneArray state_, samples_, shadow_rays_, shadow_light_;
};

}  // namespace octrad
