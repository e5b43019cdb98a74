// Camera rays on a device, in scenes that hide their emitters. For files named *_device.cc.
#pragma once

#include "octrad/device/launch.h"
#include "octrad/shading/device_world.h"
#include "octrad/transport/camera_hit_math.h"
#include "octrad/transport/camera_job.h"

namespace octrad {

struct HideEmitters : Kernel {
  DeviceWorld world;
  const CameraJob* job;
  Hit* hits;
  unsigned long long* rays;

  OCTRAD_HD void operator()(std::uint32_t k) const {
    if (k >= job->size() || !hits[k].valid()) return;
    int traced = 0;
    hits[k] = behind_emitters(world, job->sample(k).ray, hits[k], traced);
    if (traced > 0) atomic_add(rays, static_cast<unsigned long long>(traced));
  }
};

// hits[k], of the ray of sample k of the job, becomes that behind emitters. `most`: samples of a job. Rays that are
// traced are added to `rays`.
inline void hide_emitters(Stream& stream, std::size_t most, const DeviceWorld& world, const CameraJob* job, Hit* hits,
                          unsigned long long* rays) {
  if (world.hides_emitters()) launch(stream, most, HideEmitters{{}, world, job, hits, rays});
}

}  // namespace octrad
