// A radiance field in the memory of a device: queried and trained there, with the definitions of the field that it was
// made from. Weights and optimiser state move between the two in both directions.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "octrad/base/bytes.h"
#include "octrad/base/half.h"
#include "octrad/base/surface_point.h"
#include "octrad/device/stream.h"
#include "octrad/device/tuning.h"
#include "octrad/model/config.h"
#include "octrad/model/radiance_field.h"

namespace octrad {

// What changes from step to step, in device memory, so that a recorded step can be replayed.
struct StepConstants {
  float epsilon = 0.0f;                           // of the loss
  float rate_scale = 0.0f, network_scale = 0.0f;  // RateScale
};

struct DeviceFieldOptions {
  std::size_t max_points = std::size_t{1} << 20;  // queries in flight; more are split into chunks
  std::size_t max_train_points = 0;               // of a step; 0: no training
  bool deterministic = false;  // training repeats bit for bit: contributions are sorted before they are summed
  bool half_features = true;   // look-ups read tables of halves
  bool averages = false;       // not trained, but approach() and download_to() are possible
  DeviceTuning tuning = {};    // the stream's: chunks, order of queries, list of touched entries
};

// What is known of the steps since the last report.
struct DeviceTrainReport {
  std::vector<double> losses;  // mean over points and channels, in order; at most kLossHistory, the last ones
  long long steps = 0;
  long long non_finite = 0;  // gradients dropped
  long long touched = 0;     // table entries updated
};

class DeviceField {
 public:
  static constexpr int kLossHistory = 1024;
  virtual ~DeviceField() = default;

  // Predicted radiance of points 0 .. min(*count, capacity) - 1 to out. count: in device memory, null: capacity. Other
  // elements of out may be overwritten. May be recorded, as may train() and inspect(), once they have run before.
  virtual void radiance(SurfacePointArray points, const std::uint32_t* count, std::size_t capacity, Vec3f* out) = 0;

  // One optimiser step towards `targets` (linear radiance); n <= max_train_points. Channels of a point or
  // target that are not finite count as dropped gradients.
  virtual void train(SurfacePointArray points, const Vec3f* targets, std::size_t n, const StepConstants* constants) = 0;
  // Waits for the steps since the last call.
  virtual DeviceTrainReport collect() = 0;

  // Encoded features, feature f of point i at features.data[f * features.stride + i], and predicted disparity (0 for
  // fields without). Either may be null.
  virtual void inspect(SurfacePointArray points, std::size_t n, FloatRows features, float* disparity) = 0;

  // As RadianceField::take_empty_lookups. Waits for the work before.
  virtual long long take_empty_lookups() { return 0; }

  // Exposure, as RadianceField::set_target_scale. Takes effect in recorded work too.
  virtual void set_target_scale(float scale) = 0;
  virtual float target_scale() const = 0;

  // Weights, exposure and, where there is any, the optimiser's state of the field it was made from, or of one of the
  // same configuration and domain (InputError otherwise). download_to needs max_train_points > 0 or `averages`.
  virtual void upload_from(RadianceField& field) = 0;
  virtual void download_to(RadianceField& field) = 0;

  // As approach() of fields; `to` is of the same configuration and domain, on the same stream, and has
  // max_train_points > 0 or `averages`, as this one does.
  virtual void approach(const DeviceField& to, float share) = 0;
};

// A device copy of `field`, which was made with `config`. Throws MemoryError, InputError for a field that has no device
// counterpart. The stream must outlive it.
std::unique_ptr<DeviceField> make_device_field(Stream& stream, RadianceField& field, const Config& config,
                                               const DeviceFieldOptions& options);

// Memory that such a field takes, before anything is allocated.
std::vector<MemoryPart> estimate_device_memory(const Config& config, const std::vector<long long>& cells_per_level,
                                               const DeviceFieldOptions& options);

}  // namespace octrad
