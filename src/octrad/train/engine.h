// Where training steps are computed. The loop around them (train/trainer.cc: schedule, checkpoints, validation,
// interruption) is the same for all devices.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "octrad/device/stage_times.h"
#include "octrad/model/radiance_field.h"
#include "octrad/train/batch.h"

namespace octrad {

struct StepReport {
  std::vector<double> losses;  // of the steps, in order
  long long rhs_queries = 0;
  long long non_finite = 0;     // gradients dropped
  long long dropped = 0;        // right-hand-side contributions dropped, which darkens targets
  long long empty_lookups = 0;  // RadianceField::take_empty_lookups
};

class TrainEngine {
 public:
  virtual ~TrainEngine() = default;
  // Takes step number `step`; may return before it is done.
  virtual void step(long long step, const ScheduleState& s) = 0;
  // How many steps to launch before collect(), so that the device is never idle.
  virtual int steps_between_reports() const = 0;
  // Waits for the steps since the last call.
  virtual StepReport collect() = 0;
  // Milliseconds that the stages of a step took, means over the steps that were timed: some, on a device.
  virtual StageSplit stages() const { return {}; }
  // Radiance as learnt so far.
  virtual void radiance(std::span<const SurfacePoint> points, std::span<Vec3f> out) = 0;
  // The field, brought up to date with everything learnt.
  virtual RadianceField& field() = 0;
  virtual std::unique_ptr<RadianceField> release_field() = 0;
  // Points of the next step that the last one chose (train.far_ends): with the field, all that a run is in the middle
  // of.
  virtual std::vector<FarEnd> far_ends() = 0;
  virtual void set_far_ends(const std::vector<FarEnd>& far_ends) = 0;
  // RadianceField::set_target_scale, while it trains.
  virtual void set_target_scale(float scale) = 0;
  // The scene has changed. `changed`, where the engine can draw them: a share of the points from now on; null: no more.
  virtual void scene_changed(std::unique_ptr<ChangedPoints> changed, double share) = 0;
  // Points and targets of the last step.
  virtual void last_batch(std::vector<SurfacePoint>& points, std::vector<Vec3f>& targets) = 0;
};

std::unique_ptr<TrainEngine> make_cpu_engine(std::unique_ptr<BatchSource> batches,
                                             std::unique_ptr<RadianceField> field);

}  // namespace octrad
