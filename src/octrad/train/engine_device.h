// The training engine on a Stream: a CUDA device, or the host emulating one.
#pragma once

#include <memory>

#include "octrad/device/tuning.h"
#include "octrad/train/engine.h"

namespace octrad {

struct DeviceEngineOptions {
  bool deterministic = false;  // the same bits every time, at a cost
  bool half_features = true;   // look-ups read tables of halves; the masters are floats
  int group_steps = 16;        // left-hand-side points are drawn for up to so many steps at once: 1, 2, 4, 8 or 16
  DeviceTuning tuning;         // the stream's
};

// Memory of the device that training takes beside the scene.
std::vector<MemoryPart> estimate_device_training(const Config& config, const std::vector<long long>& cells_per_level,
                                                 const DeviceEngineOptions& options);

// `sampler` gives poses and rules of left-hand-side points; `averages` as in make_cpu_engine(). The stream and the
// scene must outlive the engine. Throws MemoryError, DeviceError.
std::unique_ptr<TrainEngine> make_device_engine(Stream& stream, const PreparedScene& scene, const Config& config,
                                                const LhsSampler& sampler, std::unique_ptr<RadianceField> field,
                                                std::unique_ptr<RadianceField> averages,
                                                const DeviceEngineOptions& options);

}  // namespace octrad
