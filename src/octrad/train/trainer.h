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
  double loss = 0.0;                // smoothed: see smoothed_loss()
  double validation_mape = -1.0;    // latest; -1 before the first or without a reference
  double queries_per_second = 0.0;  // right-hand-side cache queries
  double points_per_second = 0.0;
  double bytes = 0.0;  // estimated memory of the field
};

struct TrainOptions {
  std::string output;                // model file; checkpoints go to the same name
  bool save_optimizer = true;        // in the final file (checkpoints always have it)
  const Image* reference = nullptr;  // of the scene's first camera, any resolution
  double validation_seconds = 0.0;  // of training between validations; 0: chosen. Validating does not count as training
  double max_memory = 0.0;          // bytes of the device (or of the computer, without one); 0: no limit
  double used_memory = 0.0;         // of them, taken already: by the program and the scene
  Stream* stream = nullptr;         // where to train; null: on the CPU
  bool deterministic = false;       // on a device: the same bits every time, at a cost (the CPU always is)
  std::vector<Camera> cameras;      // poses in addition to the scene's
  Model* resume = nullptr;          // continue this model (its field is moved from)
  std::function<bool()> interrupted;
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

// Throws MemoryError before allocating when the estimate is over max_memory (naming what each knob saves), and
// InputError when the loss turns non-finite (the last good model stays in `output`), and IoError when the finished
// model cannot be written.
TrainResult train(const PreparedScene& scene, const Config& config, const TrainOptions& options);

// Batch shape and loss epsilon at a fraction of the budget.
struct ScheduleState {
  int points = 0, directions = 0;
  double epsilon = 0.0, rate_scale = 1.0;
};
ScheduleState schedule(const Config& config, long long step, double fraction);

// Share of the budget that is spent, in [0, 1]: of train.steps, or of train.time where that is 0.
double spent_budget(const Config& config, const TrainingState& state);

// The loss of step number `step` (from 0) joined to the smoothed loss of those before it (below 0: none): a mean over
// about the last tenth of the steps, at least 50 and at most 500.
double smoothed_loss(double smoothed, double loss, long long step);

}  // namespace octrad
