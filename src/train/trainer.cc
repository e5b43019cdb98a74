#include "train/trainer.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <fstream>

#include "base/bytes.h"
#include "base/error.h"
#include "encoding/octaoctree.h"
#include "geometry/voxelize.h"
#include "train/validation.h"
#include "transport/lhs_sampler.h"
#include "transport/rhs_estimator.h"

namespace octrad {
namespace {

using Clock = std::chrono::steady_clock;
double seconds_since(Clock::time_point start) { return std::chrono::duration<double>(Clock::now() - start).count(); }

double total_bytes(const std::vector<MemoryPart>& parts) {
  double sum = 0.0;
  for (const MemoryPart& part : parts) sum += static_cast<double>(part.bytes);
  return sum;
}

std::vector<long long> cell_counts(const FieldDomain& domain) {
  std::vector<long long> counts;
  for (const auto& cells : domain.occupied_cells) counts.push_back(static_cast<long long>(cells.size()));
  return counts;
}

// Returns the estimate. Throws MemoryError when it is above `limit` (0: none), with advice unless the run continues another,
// whose sizes are fixed.
double check_memory(const Config& config, const std::vector<long long>& cells, double limit, bool continues) {
  const std::vector<MemoryPart> parts = estimate_memory(config, cells, true);
  std::string advice;
  const auto saving = [&](const std::string& knob, const Config& changed, const std::vector<long long>& changed_cells) {
    advice += (advice.empty() ? "" : "; ") + knob + " would need " + format_bytes(total_bytes(estimate_memory(changed, changed_cells, true)));
  };
  if (config.field == "octaoctree" && config.octree_levels > 1) {
    Config fewer = config;
    --fewer.octree_levels;
    std::vector<long long> coarser(cells.begin(), cells.end() - 1);
    saving("octree.levels=" + std::to_string(fewer.octree_levels), fewer, coarser);
  }
  if (config.field == "octaoctree" && config.octree_features > 2) {
    Config narrower = config;
    narrower.octree_features /= 2;
    saving("octree.features=" + std::to_string(narrower.octree_features), narrower, cells);
  }
  if (config.train_points > 1024) {
    Config smaller = config;
    smaller.train_points /= 2;
    saving("train.points=" + std::to_string(smaller.train_points), smaller, cells);
  }
  if (continues) advice = "a run that continues keeps the sizes of its model";
  require_memory(static_cast<std::uint64_t>(std::max(0.0, limit)), "training (beside the scene)", parts, advice);
  return total_bytes(parts);
}

LhsOptions lhs_options(const Config& config) {
  LhsOptions options;
  options.walks = config.train_sampler == "area" ? 0.0 : config.train_sampler == "walks" ? 1.0 : config.train_walks * (1.0 - config.train_view_share);
  options.view = config.train_view_share;
  options.stop_probability = config.train_stop_probability;
  options.max_walk = config.train_max_walk;
  options.keep_direction = config.train_keep_direction;
  options.uniform_glossy = config.train_fresh_direction == "uniform";
  options.glossy_boost = config.train_glossy_boost;
  options.rough_threshold = static_cast<float>(config.lookup_rough_threshold);
  options.poses = config.train_poses;
  options.seed = static_cast<unsigned long long>(config.seed);
  return options;
}

// One training run: everything that lives from the first step to the last.
class Run {
 public:
  Run(const TransportContext& context, const Config& config, const TrainOptions& options)
      : context_(context), config_(config), options_(options), sampler_(context, lhs_options(config), options.cameras) {
    if (options.resume) {
      field_ = std::move(options.resume->field);
      state_ = options.resume->info.state;
      bytes_ = check_memory(config, field_->cells_per_level(), options.max_memory, true);
    } else {
      const FieldDomain domain = field_domain(context.scene, config);
      bytes_ = check_memory(config, cell_counts(domain), options.max_memory, false);
      field_ = make_field(config, domain);
      choose_exposure();
    }
    query_ = [this](std::span<const SurfacePoint> points, std::span<Vec3f> out) { field_->radiance(points, out); };
    if (options.reference) {
      validation_ = std::make_unique<Validation>(context, *options.reference, config, 8192, 2);
    }
  }

  TrainResult go();

 private:
  void draw(unsigned long long stream, const ScheduleState& s, const RadianceQuery& query);
  void choose_exposure();
  void checkpoint(bool optimizer);
  double fraction() const;
  [[noreturn]] void stop_non_finite(const std::string& why);

  TransportContext context_;
  Config config_;
  const TrainOptions& options_;
  LhsSampler sampler_;
  std::unique_ptr<RadianceField> field_;
  std::unique_ptr<Validation> validation_;
  RadianceQuery query_;
  TrainingState state_;
  double bytes_ = 0.0;
  double earlier_seconds_ = 0.0;   // of the runs that this one continues
  Clock::time_point start_;
  long long non_finite_ = 0;               // gradients dropped
  long long dropped_contributions_ = 0;    // right-hand-side contributions dropped; they cost light, not stability
  std::vector<ShadingPoint> shading_;
  std::vector<SurfacePoint> points_;
  std::vector<Vec3f> targets_;
};

// Draws a batch and estimates its targets.
void Run::draw(unsigned long long stream, const ScheduleState& s, const RadianceQuery& query) {
  const auto n = static_cast<std::size_t>(s.points);
  shading_.resize(n);
  points_.resize(n);
  targets_.resize(n);
  sampler_.sample(stream, shading_);
  RhsOptions rhs;
  rhs.directions = s.directions;
  rhs.max_chain = config_.train_max_chain;
  rhs.emission_inside = config_.target_emission == "inside";
  rhs.traced_disparity = config_.lookup_offset == "traced";
  rhs.seed = static_cast<unsigned long long>(config_.seed);
  rhs.stream = stream;
  const RhsStatistics statistics = estimate_rhs(context_, shading_, rhs, query, targets_);
  dropped_contributions_ += statistics.non_finite;
  state_.rhs_queries += statistics.queries;
  state_.lhs_samples += s.points;
  for (std::size_t i = 0; i < n; ++i) {
    points_[i] = surface_point(shading_[i]);
    const SurfaceInteraction& surface = shading_[i].surface;
    if (rhs.traced_disparity) points_[i].disparity = traced_disparity(context_, points_[i], surface.geometric_normal);
    if (rhs.emission_inside && surface.emitter >= 0) targets_[i] += context_.lights.emitted(surface, shading_[i].wo);
  }
}

// target.scale = 0: the mean luminance of direct light over a few batches, so that the network's outputs start near 1.
void Run::choose_exposure() {
  double scale = config_.target_scale;
  if (scale <= 0.0) {
    ScheduleState s = schedule(config_, 0, 0.0);
    s.points = std::min(s.points, 4096);
    double sum = 0.0;
    long long count = 0;
    for (unsigned long long batch = 0; batch < 4; ++batch) {
      draw((1ull << 62) + batch, s, nullptr);
      for (const Vec3f& t : targets_) sum += std::min(luminance(t), 100.0f);
      count += s.points;
    }
    scale = sum > 0.0 ? sum / static_cast<double>(count) : 1.0;
    state_ = TrainingState{};
  }
  field_->set_target_scale(static_cast<float>(scale));
}

double Run::fraction() const {
  if (config_.train_steps > 0) return std::min(1.0, static_cast<double>(state_.step) / config_.train_steps);
  return std::min(1.0, state_.seconds / std::max(1e-9, config_.train_seconds));
}

void Run::checkpoint(bool optimizer) {
  if (options_.output.empty()) return;
  ModelInfo info;
  info.config = config_;
  info.scene_file = context_.scene.file;
  info.scene_fingerprint = context_.scene.fingerprint;
  info.state = state_;
  save_model(options_.output, *field_, info, optimizer);
  if (options_.saved) options_.saved(options_.output, state_.step);
}

void Run::stop_non_finite(const std::string& why) {
  std::string message = "step " + std::to_string(state_.step) + ": " + why;
  if (!options_.output.empty()) {
    const std::string file = options_.output + ".bad-batch.csv";
    std::ofstream out(file);
    out << "x,y,z,wox,woy,woz,nx,ny,nz,ar,ag,ab,alpha,tr,tg,tb\n";
    for (std::size_t i = 0; i < points_.size(); ++i) {
      const SurfacePoint& p = points_[i];
      for (const Vec3f& v : {p.x, p.wo, p.n, p.albedo}) out << v.x << ',' << v.y << ',' << v.z << ',';
      out << p.alpha << ',' << targets_[i].x << ',' << targets_[i].y << ',' << targets_[i].z << '\n';
    }
    message += "; the batch is in " + file + ", and " + options_.output + " is the last good checkpoint, if one was written";
  }
  throw InputError(message + "; try a lower adam.rate.features or adam.rate.networks, or another target.scale");
}

TrainResult Run::go() {
  TrainResult result;
  start_ = Clock::now();
  earlier_seconds_ = state_.seconds;
  const long long first_step = state_.step, first_queries = state_.rhs_queries;
  double next_progress = 0.0, next_checkpoint = config_.checkpoint_seconds, next_validation = 5.0;
  double smoothed = -1.0, mape = -1.0;
  while (fraction() < 1.0) {
    if (options_.interrupted && options_.interrupted()) {
      result.interrupted = true;
      break;
    }
    const ScheduleState s = schedule(config_, state_.step, fraction());
    draw(static_cast<unsigned long long>(state_.step), s, query_);
    const FieldStep step = field_->train(points_, targets_, s.epsilon, s.rate_scale);
    non_finite_ += step.non_finite;
    if (!std::isfinite(step.loss)) stop_non_finite("the loss is not finite");
    if (non_finite_ > config_.adam_max_non_finite) stop_non_finite(std::to_string(non_finite_) + " gradients were not finite (adam.max_non_finite)");
    ++state_.step;
    smoothed = smoothed < 0.0 ? step.loss : smoothed + (step.loss - smoothed) * 0.02;
    const double seconds = seconds_since(start_);
    state_.seconds = earlier_seconds_ + seconds;
    if (validation_ && seconds >= next_validation) {
      mape = validation_->mape(*field_);
      next_validation = seconds_since(start_) + std::max(5.0, 0.02 * config_.train_seconds);
    }
    if (options_.progress && seconds >= next_progress) {
      TrainProgress p;
      p.step = state_.step;
      p.steps = config_.train_steps;
      p.seconds = state_.seconds;
      p.fraction = fraction();
      p.loss = smoothed;
      p.validation_mape = mape;
      p.queries_per_second = static_cast<double>(state_.rhs_queries - first_queries) / seconds;
      p.points_per_second = static_cast<double>(state_.step - first_step) * s.points / seconds;
      p.bytes = bytes_;
      options_.progress(p);
      next_progress = seconds + 0.2;
    }
    if (seconds >= next_checkpoint && fraction() < 1.0) {
      checkpoint(true);
      next_checkpoint = seconds_since(start_) + config_.checkpoint_seconds;
    }
  }
  checkpoint(options_.save_optimizer || result.interrupted);
  if (options_.reference) result.validation_mape = Validation(context_, *options_.reference, config_, 1 << 20, 4).mape(*field_);
  result.steps = state_.step;
  result.seconds = state_.seconds;
  result.lhs_samples = state_.lhs_samples;
  result.rhs_queries = state_.rhs_queries;
  result.loss = std::max(0.0, smoothed);
  result.dropped_contributions = dropped_contributions_;
  result.field = std::move(field_);
  return result;
}

}  // namespace

FieldDomain field_domain(const Scene& scene, const Config& config) {
  const Domain box = scene_domain(scene.bounds, config.octree_box == "cube");
  FieldDomain domain{box.origin, box.size, {}};
  if (config.field == "octaoctree") {
    domain.occupied_cells = config.octree_occupancy == "sampled"
                                ? sampled_cells(scene, box, config.octree_levels, static_cast<unsigned long long>(config.seed))
                                : occupied_cells(scene, box, config.octree_levels);
  }
  return domain;
}

TrainResult train(const TransportContext& context, const Config& config, const TrainOptions& options) { return Run(context, config, options).go(); }

}  // namespace octrad
