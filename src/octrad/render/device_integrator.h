// The interface of integrators to DeviceRenderer. Internal to the module.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "octrad/device/stage_times.h"
#include "octrad/model/device_field.h"
#include "octrad/render/render_loop.h"
#include "octrad/shading/device_world.h"
#include "octrad/transport/camera_job.h"

namespace octrad {

// Finds what the samples of a job see.
class DeviceIntegrator {
 public:
  virtual ~DeviceIntegrator() = default;
  // What the next run() sees; not while the stream records.
  virtual void set(const CameraJob& job) = 0;
  virtual void run(std::size_t samples, const StageMark& mark) = 0;
  virtual const CameraJob* job() const = 0;  // device memory
  virtual SamplePlanes samples() const = 0;
  virtual SampleCounts take_counts() = 0;  // since the last call
  virtual bool can_be_recorded() const { return true; }
  // After the last job.
  virtual void finish(RenderResult&) {}
};

// device_views.cc: views of what a field holds (cache_integrators.h). Rays and look-ups are the stream's; colours are
// the host's, so it cannot be recorded. `view` must be one of the field's.
std::unique_ptr<DeviceIntegrator> make_view_integrator(Stream& stream, const DeviceWorld& world,
                                                       DeviceField& device_field, const RadianceField& field,
                                                       const Config& config, const std::string& view,
                                                       const RenderOptions& options, std::size_t capacity);
std::size_t view_integrator_bytes(const RadianceField& field, const Config& config, const std::string& view,
                                  std::size_t capacity);

}  // namespace octrad
