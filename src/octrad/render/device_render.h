// Pictures on a Stream: the passes of render/render_loop.h with integrators that run on a device.
#pragma once

#include <memory>
#include <string>

#include "octrad/device/stage_times.h"
#include "octrad/model/radiance_field.h"
#include "octrad/render/render_loop.h"
#include "octrad/transport/prepared_scene.h"

namespace octrad {

// Milliseconds of a frame: first hits, field, film and tone mapping; everything on the device, warm.
struct FrameTimes {
  double median = 0.0, p95 = 0.0;
  StageSplit stages;  // medians, measured in frames of their own
};

class DeviceRenderer {
 public:
  // integrator: path, or with a field lhs, rhs or deferred (one direction a sample, as on the CPU), or one of its
  // views. Samples are taken in jobs that fit into `max_memory` bytes (0: no limit) beside scene and field; throws
  // MemoryError where not even one row does, UsageError for a view that the field does not have. The stream, the field
  // and the context must outlive it.
  DeviceRenderer(Stream& stream, const PreparedScene& scene, const RenderOptions& options, RadianceField* field,
                 const Config& config, const std::string& integrator, std::uint64_t max_memory);
  ~DeviceRenderer();

  // As octrad::render() on the CPU: the same samples, sums in double in a fixed order.
  RenderResult render();
  // `count` frames of options.spp samples a pixel, tone-mapped to 8 bits. Throws MemoryError unless a whole frame is
  // one job, and UsageError for views.
  FrameTimes time_frames(int count);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace octrad
