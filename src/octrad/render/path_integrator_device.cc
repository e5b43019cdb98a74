#include "octrad/render/integrators.h"
#include "octrad/shading/device_world.h"
#include "octrad/transport/path_device.h"

namespace octrad {
namespace {

class PathIntegrator : public DeviceIntegrator {
 public:
  PathIntegrator(Stream& stream, const DeviceWorld& world, const PathLimits& limits, std::size_t capacity)
      : stream_(stream),
        tracer_(stream, world, capacity),
        limits_(limits) {}
  void set(const CameraJob& job) override { tracer_.set(job); }
  void run(std::size_t samples) override {
    tracer_.run(limits_, samples);
    stream_.mark("paths");
  }
  const CameraJob* job() const override { return tracer_.job(); }
  SamplePlanes samples() const override { return tracer_.samples(); }
  SampleCounts take_counts() override {
    SampleCounts counts;
    counts.rays = static_cast<long long>(tracer_.take_rays());
    return counts;
  }

 private:
  Stream& stream_;
  DevicePathTracer tracer_;
  PathLimits limits_;
};

}  // namespace

std::unique_ptr<DeviceIntegrator> make_device_path_integrator(const IntegratorInput& input, Stream& stream,
                                                              const DeviceWorld& world, DeviceField*,
                                                              std::size_t capacity) {
  return std::make_unique<PathIntegrator>(stream, world, PathLimits{input.max_depth, input.rr_depth}, capacity);
}

std::size_t device_path_integrator_bytes(const IntegratorInput&, std::size_t capacity) {
  return DevicePathTracer::bytes(capacity);
}

}  // namespace octrad
