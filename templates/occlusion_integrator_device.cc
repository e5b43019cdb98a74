#include "octrad/device/launch.h"
#include "octrad/render/occlusion_integrator.h"
#include "octrad/render/occlusion_math.h"
#include "octrad/shading/device_world.h"
#include "octrad/transport/camera_job.h"
#include "octrad/transport/device_memory.h"

namespace octrad {
namespace {

struct Occlusion : Kernel {
  DeviceWorld world;
  const CameraJob* job;
  float reach;
  SamplePlanes samples;
  OCTRAD_HD void operator()(std::uint32_t k) const {
    if (k >= job->size()) return;  // a recorded launch may serve a smaller job
    FirstHit first;
    samples.set_radiance(k, occlusion(world, job->sample(k), reach, first));
    samples.set_first(k, first);
  }
};

class OcclusionIntegrator : public DeviceIntegrator {
 public:
  OcclusionIntegrator(Stream& stream, const DeviceWorld& world, float reach, std::size_t capacity)
      : stream_(stream),
        world_(world),
        reach_(reach),
        job_(stream, 1, "the camera's job"),
        samples_(stream, kSampleNumbers, capacity, "samples") {}

  void set(const CameraJob& job) override { job_.upload(std::span(&job, 1)); }
  void run(std::size_t samples) override {
    launch(stream_, samples, Occlusion{{}, world_, job_.data(), reach_, this->samples()});
    rays_ += 2 * static_cast<long long>(samples);
    stream_.mark("occlusion");
  }
  const CameraJob* job() const override { return job_.data(); }
  SamplePlanes samples() const override { return {samples_.planes()}; }
  SampleCounts take_counts() override {
    SampleCounts counts;
    counts.rays = std::exchange(rays_, 0);
    return counts;
  }

 private:
  Stream& stream_;
  DeviceWorld world_;
  float reach_;
  DeviceArray<CameraJob> job_;
  PlaneArray samples_;
  long long rays_ = 0;
};

}  // namespace

std::unique_ptr<DeviceIntegrator> make_device_occlusion_integrator(const IntegratorInput& input, Stream& stream,
                                                                   const DeviceWorld& world, DeviceField*,
                                                                   std::size_t capacity) {
  return std::make_unique<OcclusionIntegrator>(stream, world, occlusion_reach(input.scene.scene()), capacity);
}

std::size_t device_occlusion_integrator_bytes(const IntegratorInput&, std::size_t capacity) {
  return sizeof(CameraJob) + kSampleNumbers * capacity * sizeof(float);
}

}  // namespace octrad
