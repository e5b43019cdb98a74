#include "octrad/train/schedule.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace octrad {
namespace {

// What multiplies the rates at a fraction of the budget, but for the warm-up.
double decay_at(const Config& config, double fraction) {
  if (fraction <= config.adam_decay_start || config.adam_decay_start >= 1.0) return 1.0;
  const double t = std::min(1.0, (fraction - config.adam_decay_start) / (1.0 - config.adam_decay_start));
  return config.adam_decay_to + (1.0 - config.adam_decay_to) * 0.5 * (1.0 + std::cos(t * std::numbers::pi));
}

// What is left of far ends and of points by area. As the cube of the rates: none below half of the rates. In eighths:
// devices record a step anew for each.
double left_of_points(double decay) { return std::floor(8.0 * decay * decay * decay) / 8.0; }

}  // namespace

ScheduleState schedule(const Config& config, long long step, double fraction) {
  ScheduleState s;
  const int quarter = std::clamp(static_cast<int>(fraction * 4.0), 0, 3);
  s.points = config.train_points;
  s.directions = config.train_directions;
  if (config.train_quarters) {
    s.points = std::max(64, s.points >> quarter);
    s.directions <<= quarter;
  }
  if (config.train_first_points > 0) s.points = std::min(s.points, std::max(64, config.train_first_points) << quarter);
  s.epsilon = config.loss_epsilon_first * std::pow(config.loss_epsilon_last / config.loss_epsilon_first, quarter / 3.0);
  const double decay = decay_at(config, fraction);
  s.rate_scale = decay * std::min(1.0, static_cast<double>(step + 1) / std::max(1, config.adam_warmup));
  s.far_ends = static_cast<int>(config.train_far_ends * s.points * left_of_points(decay));
  if (config.train_area_falls && config.train_sampler == TrainSampler::mixture) {
    const long long first = step - step % kDrawnTogether;
    const double drawn_at = config.train_steps > 0 ? static_cast<double>(first) / config.train_steps : fraction;
    s.by_area = left_of_points(decay_at(config, drawn_at));
  }
  s.network_scale = s.rate_scale;
  if (config.field == "octaoctree" && config.adam_rate_budget > 0) {
    const double steps = config.train_steps > 0 ? config.train_steps
                         : fraction > 0.0       ? static_cast<double>(step) / fraction
                                                : 0.0;  // of the budget
    s.network_scale /= std::sqrt(1.0 + steps / config.adam_rate_budget);
  }
  return s;
}

double average_share(const Config& config, long long steps, double rate_scale) {
  // An average passes over all weights.
  constexpr long long interval = 64;
  const double window = config.train_average * static_cast<double>(steps) * std::sqrt(rate_scale);
  if (window <= static_cast<double>(interval)) return 1.0;
  return steps % interval == 0 ? static_cast<double>(interval) / window : 0.0;
}

double spent_budget(const Config& config, const TrainingState& state) {
  if (config.train_steps > 0) return std::min(1.0, static_cast<double>(state.step) / config.train_steps);
  return std::min(1.0, state.seconds / std::max(1e-9, config.train_seconds));
}

double smoothed_loss(double smoothed, double loss, long long step) {
  if (smoothed < 0.0) return loss;
  const long long window = std::min(step + 1, std::clamp(step / 10, 50LL, 500LL));
  return smoothed + (loss - smoothed) / static_cast<double>(window);
}

}  // namespace octrad
