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
  // What the field answers that is shown: the one that steps move, or where there is one that of the averages of its
  // weights.
  virtual void radiance(std::span<const SurfacePoint> points, std::span<Vec3f> out) = 0;
  // The field that is shown, brought up to date.
  virtual RadianceField& field() = 0;
  virtual std::unique_ptr<RadianceField> release_field() = 0;
  // The field that steps move, brought up to date, where another one is shown; null otherwise.
  virtual RadianceField* trained() = 0;
  // approach() of the averages towards the weights as they are after the steps so far. Nothing where there are none.
  virtual void average(double share) = 0;
  // Points of the next step that the last one chose (train.far_ends): with the field, all that a run is in the middle
  // of.
  virtual std::vector<FarEnd> far_ends() = 0;
  virtual void set_far_ends(const std::vector<FarEnd>& far_ends) = 0;
  // What directions of right-hand sides are drawn by (train.guide); likewise. Empty: by the BSDF alone.
  virtual GuideState guide() = 0;
  virtual void set_guide(const GuideState& guide) = 0;
  // RadianceField::set_target_scale, while it trains.
  virtual void set_target_scale(float scale) = 0;
  // The scene has changed. `changed`, where the engine can draw them: a share of the points from now on; null: no more.
  virtual void scene_changed(std::unique_ptr<ChangedPoints> changed, double share) = 0;
  // Points and targets of the last step.
  virtual void last_batch(std::vector<SurfacePoint>& points, std::vector<Vec3f>& targets) = 0;
};

// `averages` as Model::field beside Model::trained; may be null.
std::unique_ptr<TrainEngine> make_cpu_engine(std::unique_ptr<BatchSource> batches, std::unique_ptr<RadianceField> field,
                                             std::unique_ptr<RadianceField> averages);

}  // namespace octrad
