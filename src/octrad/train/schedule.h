// What changes over a training: the shape of batches, the loss's epsilon, learning rates, averages of the weights.
#pragma once

#include "octrad/model/config.h"
#include "octrad/model/model_file.h"

namespace octrad {

// Steps whose left-hand-side points a device draws at once, at most: what they are drawn by changes only where step
// numbers are multiples of this, if the budget is in steps.
inline constexpr int kDrawnTogether = 16;

// Batch shape and loss epsilon at a fraction of the budget.
struct ScheduleState {
  int points = 0, directions = 0;
  int far_ends = 0;                        // of the points: where rays of the last step ended
  double by_area = 1.0;                    // what is left of the share of points by area
  double epsilon = 0.0, rate_scale = 1.0;  // of tables' learning rates
  double network_scale = 1.0;              // of networks': rate_scale, and adam.rate.budget
};
ScheduleState schedule(const Config& config, long long step, double fraction);
// Where its quarters begin: in each, all steps have as many points and directions.
inline constexpr double kQuarters[] = {0.0, 0.25, 0.5, 0.75};

// What train.average does after `steps` steps: by what share the averages approach the weights. 0: nothing; 1: they are
// the weights, as long as the steps to average over are few. In between their weight falls as exp(-age / window), with
// a window of train.average * steps * sqrt(rate_scale): at lower rates weights spread less, and old ones are further
// off.
double average_share(const Config& config, long long steps, double rate_scale);

// Share of the budget that is spent, in [0, 1]: of train.steps, or of train.time where that is 0.
double spent_budget(const Config& config, const TrainingState& state);

// The loss of step number `step` (from 0) joined to the smoothed loss of those before it (below 0: none): a mean over
// about the last tenth of the steps, at least 50 and at most 500.
double smoothed_loss(double smoothed, double loss, long long step);

}  // namespace octrad
