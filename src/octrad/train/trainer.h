// The training loop (method section 7): left-hand-side points, right-hand-side targets, one optimiser step; schedule,
// checkpoints, validation, interruption.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "octrad/device/stage_times.h"
#include "octrad/image/image.h"
#include "octrad/model/config.h"
#include "octrad/model/model_file.h"
#include "octrad/train/domain.h"
#include "octrad/transport/prepared_scene.h"

namespace octrad {

struct TrainProgress {
  long long step = 0, steps = 0;    // steps: 0 when the run is bounded by time
  double seconds = 0.0;             // of training so far
  double fraction = 0.0;            // of the budget
  double rate_scale = 0.0;          // of the learning rates, in the last step
  double loss = 0.0;                // smoothed: see smoothed_loss() (train/schedule.h)
  double validation_mape = -1.0;    // latest; -1 before the first or without a reference
  double queries_per_second = 0.0;  // right-hand-side cache queries
  double points_per_second = 0.0;
};

struct TrainOptions {
  std::string output;                // model file; checkpoints go to the same name
  bool save_optimizer = true;        // in the final file (checkpoints always have it)
  const Image* reference = nullptr;  // of the scene's first camera, any resolution
  double validation_seconds = 0.0;  // of training between validations; 0: chosen. Validating does not count as training
  double time_limit = 0.0;     // seconds of training after which a budget in steps ends too, all runs together; 0: none
  double max_memory = 0.0;     // bytes of the device (or of the computer, without one); 0: no limit
  double used_memory = 0.0;    // of them, taken already: by the program and the scene
  Stream* stream = nullptr;    // where to train; null: on the CPU
  bool deterministic = false;  // on a device: the same bits every time, at a cost (the CPU always is)
  std::vector<Camera> cameras;        // poses in addition to the scene's
  Model* resume = nullptr;            // continue this model (its field is moved from); not used after the constructor
  std::function<bool()> interrupted;  // train() asks it before each step
  std::function<void(const DomainFit&)> placed;        // the box of a new field, before it is made
  std::function<void(const TrainProgress&)> progress;  // several times a second
  std::function<void(long long step, double seconds, double mape)> validated;  // each time it is measured
  std::function<void(const std::string& file, long long step)> saved;
  // A checkpoint could not be written, and why: training goes on, and the next one tries again. Null: train() throws.
  std::function<void(const std::string& why, long long step)> not_saved;
};

struct TrainResult {
  long long steps = 0;
  double seconds = 0.0;
  long long lhs_samples = 0, rhs_queries = 0;
  double loss = -1.0;                   // smoothed; below 0 if there was no step
  long long dropped_contributions = 0;  // of right-hand sides, because they were not finite
  long long empty_lookups = 0;          // of a level, that found no occupied cell: its features were 0
  double memory = 0.0;                  // estimated bytes of training, without TrainOptions::used_memory
  StageSplit stages;              // mean milliseconds of a step's stages; empty on the CPU and for very short runs
  double validation_mape = -1.0;  // of the finished model against the reference
  bool interrupted = false;
  std::unique_ptr<RadianceField> field;
};

// One training run, from the first step to the last.
class Trainer {
 public:
  // A new field, or that of options.resume. The scene and what `options` point to, but for `resume`, must outlive the
  // trainer. Throws MemoryError before allocating when the estimate is over max_memory (naming what each knob saves).
  Trainer(const PreparedScene& scene, const Config& config, const TrainOptions& options);
  ~Trainer();

  // The next step; now and then it validates, reports progress and saves a checkpoint, as the options say. Throws
  // InputError when the loss turns non-finite (the last good model stays in `output`).
  void step();
  // Whether the budget is spent and the last change of the scene is learnt; one can take steps nevertheless.
  bool done() const;
  // Does something that is no training and whose time does not count, after the steps taken so far.
  void untimed(const std::function<void()>& work);
  // The field, brought up to date; between steps. Its address does not change.
  RadianceField& field();
  const TrainingState& state() const;
  TrainProgress progress() const;
  const Config& config() const;
  // Where the last step was taken.
  std::vector<SurfacePoint> last_points();
  // Writes `output` as it is. Throws IoError.
  void checkpoint(bool optimizer);
  // The step of the last checkpoint that this object wrote, -1: none; why the last one failed, empty: it did not.
  long long saved_step() const;
  const std::string& not_saved() const;

  // The scene's lights or materials have been edited (PreparedScene::set_light_factor ...), between steps. What is the
  // same for all of the emission, a factor, is applied at once: radiance is linear in it. The rest is learnt in the
  // next kChangeSteps steps, at higher learning rates that fall to those of the schedule, and with a share of the
  // points on what changed and on what it lights. While nothing emits, radiance is 0 and steps change nothing. From the
  // first change on there is no validation: the reference shows another scene.
  void scene_changed(const SceneChange& change);
  static constexpr long long kChangeSteps = 1500;
  // Steps that it still takes; 0: all changes are learnt.
  long long change_steps_left() const;
  // Whether all lights are off: steps do nothing then.
  bool is_dark() const;

  // Saves and ends: the field moves into the result. Throws IoError when the model cannot be written.
  TrainResult finish(bool interrupted);

 private:
  class Run;
  std::unique_ptr<Run> run_;
};

// Trains until the budget is spent. Throws what Trainer throws.
TrainResult train(const PreparedScene& scene, const Config& config, const TrainOptions& options);

}  // namespace octrad
