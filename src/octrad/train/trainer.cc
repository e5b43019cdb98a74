#include "octrad/train/trainer.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <sstream>
#include <utility>

#include "octrad/base/atomic_file.h"
#include "octrad/base/bytes.h"
#include "octrad/base/error.h"
#include "octrad/base/memory_limit.h"
#include "octrad/base/work_clock.h"
#include "octrad/model/field_registry.h"
#include "octrad/scene/fingerprint.h"
#include "octrad/train/engine_device.h"
#include "octrad/train/schedule.h"
#include "octrad/train/training_state.h"
#include "octrad/train/validation.h"

namespace octrad {
namespace {

// Estimate of what training will allocate: on the device where there is one.
using MemoryEstimate = std::function<std::vector<MemoryPart>(const Config&, const std::vector<long long>& cells)>;

DeviceEngineOptions engine_options(const TrainOptions& options) {
  DeviceEngineOptions device;
  device.deterministic = options.deterministic;
  device.tuning = options.stream->tuning;
  return device;
}

MemoryEstimate memory_estimate(const TrainOptions& options) {
  if (!options.stream)
    return
        [](const Config& config, const std::vector<long long>& cells) { return estimate_memory(config, cells, true); };
  return [device = engine_options(options)](const Config& config, const std::vector<long long>& cells) {
    return estimate_device_training(config, cells, device);
  };
}

// Returns the estimate. Throws MemoryError when it and what is taken already are above the limit, with advice unless
// the run continues another, whose sizes are fixed.
double check_memory(const TrainOptions& options, const Config& config, const std::vector<long long>& cells) {
  const MemoryEstimate estimate = memory_estimate(options);
  std::vector<MemoryPart> parts = estimate(config, cells);
  const auto bytes = static_cast<double>(total_bytes(parts));
  parts.push_back({options.stream ? "the scene" : "the program and the scene, in memory already",
                   static_cast<std::uint64_t>(options.used_memory)});
  std::string advice;
  auto changes = field_entry(config.field).smaller(config);
  if (config.train_points > 1024) changes.emplace_back("train.points", std::to_string(config.train_points / 2));
  if (config.train_average > 0.0) changes.emplace_back("train.average", "0");
  for (const auto& [key, value] : changes) {
    Config changed = config;
    set(changed, key, value);
    std::vector<long long> fewer = cells;
    fewer.resize(std::min(cells.size(), static_cast<std::size_t>(field_entry(config.field).cell_levels(changed))));
    const auto needed = static_cast<double>(total_bytes(estimate(changed, fewer)));
    if (needed >= bytes) continue;  // as of train.points where train.first_points is the limit
    advice += fmt::format("{}{}={} would need {}", advice.empty() ? "" : "; ", key, value,
                          format_bytes(options.used_memory + needed));
  }
  if (options.resume) advice = "a run that continues keeps the sizes of its model";
  require_memory(static_cast<std::uint64_t>(std::max(0.0, options.max_memory)), "training", parts, advice);
  return bytes;
}

// Of learning rates after a change, in steps; share of the points on what changed and on what it lights.
constexpr double kChangeHalves = 50.0, kChangeShare = 0.15;

}  // namespace

// Everything that lives from the first step to the last.
class Trainer::Run {
 public:
  Run(const PreparedScene& scene, const Config& config, const TrainOptions& options)
      : scene_(scene),
        config_(config),
        options_(options) {
    auto batches = std::make_unique<BatchSource>(scene, config_, options.cameras);
    std::unique_ptr<RadianceField> field, averages;  // averages: null without train.average
    if (options.resume) {
      field = std::move(options.resume->field);
      if (options.resume->trained) averages = std::exchange(field, std::move(options.resume->trained));
      else if (config.train_average > 0.0)
        throw InputError(
            "train.average is above 0 and the model to be trained on has averages alone: load it with its optimiser's "
            "state");
      state_ = options.resume->info.state;
      saved_step_ = state_.step;
      bytes_ = check_memory(options, config, field->cells_per_level());
    } else {
      const DomainFit fit = fit_domain(scene, config, options.cameras);
      if (options.placed) options.placed(fit);
      const FieldDomain domain = field_domain(scene.scene(), config, fit.box);
      const std::vector<long long> cells = domain.cells_per_level();
      bytes_ = check_memory(options, config, cells);
      // The computer holds what checkpoints of a training on a device are written from.
      if (options.stream != nullptr)
        ask_memory(static_cast<std::uint64_t>(estimate_model_file_size(config, cells).total),
                   "the model in the computer's memory");
      field = make_field(config, domain);
      if (config.train_average > 0.0) averages = make_field(config, domain);
      const double scale = config.target_scale > 0.0 ? config.target_scale : mean_direct_light(*batches, config_);
      for (RadianceField* f : {field.get(), averages.get()})
        if (f != nullptr) f->set_target_scale(static_cast<float>(scale));
    }
    state_.sensors = sensors_fingerprint(scene.scene(), options.cameras);
    exposure_ = static_cast<double>(field->target_scale());
    GuideState directions;  // what they are drawn by
    if (config.train_guide > 0.0) {
      directions = state_.guide_rows.empty() ? make_guide(guide_box(batches->sampler()), static_cast<float>(exposure_))
                                             : stored_guide(state_);
      guide_box_ = directions.box;
      store_guide({}, state_);  // the engine has it
    }
    if (options.stream) {
      engine_ = make_device_engine(*options.stream, scene, config_, batches->sampler(), std::move(field),
                                   std::move(averages), engine_options(options));
    } else {
      engine_ = make_cpu_engine(std::move(batches), std::move(field), std::move(averages));
    }
    engine_->set_far_ends(stored_far_ends(state_, scene.scene()));
    if (!directions.empty()) engine_->set_guide(directions);
    if (options.reference) {
      validation_ = std::make_unique<Validation>(scene.context(), *options.reference, config, 8192, 2);
    }
    was_done_ = done();
    earlier_seconds_ = state_.seconds;
    first_samples_ = state_.lhs_samples;
    first_queries_ = state_.rhs_queries;
    // A GPU is quick to query and to train: validate often.
    between_validations_ = options_.validation_seconds > 0.0 ? options_.validation_seconds
                           : options_.stream && options_.stream->on_device()
                               ? 0.5
                               : std::max(5.0, 0.02 * config_.train_seconds);
    next_validation_ = std::min(5.0, between_validations_);
    next_checkpoint_ = config_.checkpoint_seconds;
    emission_ = emission();
    averages_are_weights_ = average_share_now() >= 1.0;
  }

  void step();
  long long saved_step() const { return has_saved_ ? saved_step_ : -1; }
  const std::string& not_saved() const { return not_saved_; }
  bool done() const { return (fraction() >= 1.0 || out_of_time()) && change_steps_left() == 0; }
  void untimed(const std::function<void()>& work);
  RadianceField& field() {
    bring_up_averages();
    return engine_->field();
  }
  const TrainingState& state() const { return state_; }
  TrainProgress progress() const;
  const Config& config() const { return config_; }
  std::vector<SurfacePoint> last_points();
  void checkpoint(bool optimizer);
  void scene_changed(const SceneChange& change);
  long long change_steps_left() const { return std::max(0LL, change_ends_ - state_.step); }
  bool is_dark() const { return dark_; }
  TrainResult finish(bool interrupted);

 private:
  void try_checkpoint();
  void save_result(bool optimizer);
  double fraction() const { return spent_budget(config_, state_); }
  bool out_of_time() const { return options_.time_limit > 0.0 && state_.seconds >= options_.time_limit; }
  ScheduleState schedule_now() const;
  double average_share_now() const;
  void average();
  void bring_up_averages();
  void settle();
  void report();
  void show_darkness() { engine_->set_target_scale(static_cast<float>(exposure_ * 1e-20)); }
  std::vector<Vec3f> emission() const;
  [[noreturn]] void stop_non_finite(long long step, const std::string& why);

  const PreparedScene& scene_;
  Config config_;
  const TrainOptions options_;
  std::unique_ptr<TrainEngine> engine_;
  std::unique_ptr<Validation> validation_;
  TrainingState state_;
  double bytes_ = 0.0;
  double exposure_ = 1.0;                            // of the field: the unit of the loss's epsilon
  long long saved_step_ = -1;                        // what the file holds; -1: nothing of this run
  bool has_saved_ = false;                           // in this run
  std::string not_saved_;                            // why the last checkpoint failed
  double earlier_seconds_ = 0.0;                     // of the runs that this one continues
  long long first_samples_ = 0, first_queries_ = 0;  // of the runs before
  WorkClock clock_;
  bool started_ = false;
  bool was_done_ = false;  // after the step before
  double between_validations_ = 0.0, next_validation_ = 0.0, next_progress_ = 0.0, next_checkpoint_ = 0.0;  // seconds
  double mape_ = -1.0;
  int waiting_ = 0;  // steps launched and not yet collected
  double rate_scale_ = 0.0;
  bool averages_are_weights_ = true;  // average_share() after the last step was 1
  long long copied_after_step_ = -1;  // the last step after which bring_up_averages() copied the weights
  long long non_finite_ = 0;          // gradients dropped
  long long empty_lookups_ = 0;
  long long dropped_contributions_ = 0;           // right-hand-side contributions dropped, which darkens targets
  Bounds3f guide_box_;                            // of the guide of directions
  std::vector<Vec3f> emission_;                   // factors of the lights that the field stands for
  bool dark_ = false;                             // nothing emits
  SceneChange dark_change_;                       // what changed since then
  long long change_began_ = 0, change_ends_ = 0;  // steps
};

void Trainer::Run::checkpoint(bool optimizer) {
  if (options_.output.empty()) return;
  if (waiting_ > 0) settle();
  ModelInfo info;
  info.config = config_;
  info.scene_file = scene_.scene().file;
  info.scene_fingerprint = scene_.fingerprint();
  info.state = state_;
  if (optimizer) {
    store_far_ends(engine_->far_ends(), info.state);
    store_guide(engine_->guide(), info.state);
  }
  struct Lit {  // a file has the exposure that can be trained on, also while all lights are off
    explicit Lit(Run& of) : run(of) {
      if (run.dark_) run.engine_->set_target_scale(static_cast<float>(run.exposure_));
    }
    ~Lit() {
      if (run.dark_) run.show_darkness();
    }
    Run& run;
  };
  {
    const Lit lit(*this);
    try {
      save_model(options_.output, field(), info, optimizer, optimizer ? engine_->trained() : nullptr);
    } catch (const IoError& error) {
      not_saved_ = error.what();
      throw;
    }
  }
  saved_step_ = state_.step;
  has_saved_ = true;
  not_saved_.clear();
  if (options_.saved) options_.saved(options_.output, state_.step);
}

void Trainer::Run::save_result(bool optimizer) {
  try {
    checkpoint(optimizer);
  } catch (const IoError& error) {
    throw IoError(std::string(error.what()) + (saved_step_ < 0
                                                   ? "; nothing of this run is saved"
                                                   : "; what is saved is step " + std::to_string(saved_step_)));
  }
}

void Trainer::Run::try_checkpoint() {
  try {
    checkpoint(true);
  } catch (const IoError& error) {
    if (!options_.not_saved) throw;
    options_.not_saved(error.what(), state_.step);
  }
}

// Takes over what the engine's steps since the last call reported.
void Trainer::Run::settle() {
  waiting_ = 0;
  const StepReport report = engine_->collect();
  state_.rhs_queries += report.rhs_queries;
  dropped_contributions_ += report.dropped;
  empty_lookups_ += report.empty_lookups;
  non_finite_ += report.non_finite;
  long long step = state_.step - static_cast<long long>(report.losses.size());
  for (const double loss : report.losses) {
    if (!std::isfinite(loss)) stop_non_finite(step, "the loss is not finite");
    state_.loss = smoothed_loss(state_.loss, loss, step);
    ++step;
  }
  if (non_finite_ > config_.adam_max_non_finite) {
    stop_non_finite(state_.step - 1, std::to_string(non_finite_) + " gradients were not finite (adam.max_non_finite)");
  }
}

void Trainer::Run::stop_non_finite(long long step, const std::string& why) {
  std::string message = "step " + std::to_string(step) + ": " + why;
  if (!options_.output.empty()) {
    const std::string file = options_.output + ".bad-batch.csv";
    std::ostringstream out;
    std::vector<SurfacePoint> points;
    std::vector<Vec3f> targets;
    engine_->last_batch(points, targets);
    out << "x,y,z,wox,woy,woz,nx,ny,nz,ar,ag,ab,alpha,tr,tg,tb\n";
    for (std::size_t i = 0; i < points.size(); ++i) {
      const SurfacePoint& p = points[i];
      for (const Vec3f& v : {p.x, p.wo, p.n, p.albedo}) out << v.x << ',' << v.y << ',' << v.z << ',';
      out << p.alpha << ',' << targets[i].x << ',' << targets[i].y << ',' << targets[i].z << '\n';
    }
    try {
      write_file(file, out.str());
      message += "; the batch is in " + file;
    } catch (const IoError& error) {
      message += std::string("; ") + error.what();
    }
    message += ", and " + options_.output + " is the last good checkpoint, if one was written";
  }
  throw InputError(message + "; try a lower adam.rate.features or adam.rate.networks, or another target.scale");
}

std::vector<SurfacePoint> Trainer::Run::last_points() {
  std::vector<SurfacePoint> points;
  std::vector<Vec3f> targets;
  engine_->last_batch(points, targets);
  return points;
}

// A change is learnt at the full rates, which then fall as 1 / steps to those of the schedule.
ScheduleState Trainer::Run::schedule_now() const {
  ScheduleState s = schedule(config_, state_.step, fraction());
  s.epsilon *= exposure_;
  if (change_steps_left() > 0) {
    const auto steps = static_cast<double>(state_.step - change_began_);
    const double change = kChangeHalves / (kChangeHalves + steps);
    s.rate_scale = std::max(s.rate_scale, change);
    s.network_scale = std::max(s.network_scale, change);
  }
  return s;
}

// Averages begin anew where a change of the scene began to be learnt.
double Trainer::Run::average_share_now() const {
  return average_share(config_, state_.step - change_began_, schedule_now().rate_scale);
}

// After a step.
void Trainer::Run::average() {
  const double share = average_share_now();
  const bool was_weights = std::exchange(averages_are_weights_, share >= 1.0);
  if (averages_are_weights_) return;  // copied when they are looked at
  if (was_weights) engine_->average(1.0);
  else if (share > 0.0) engine_->average(share);
}

// Before the averages are looked at.
void Trainer::Run::bring_up_averages() {
  if (!averages_are_weights_ || copied_after_step_ == state_.step) return;
  engine_->average(1.0);
  copied_after_step_ = state_.step;
}

void Trainer::Run::step() {
  if (!std::exchange(started_, true)) clock_.back_to(0.0);  // what came before was no training
  if (dark_) return;
  const ScheduleState s = schedule_now();
  rate_scale_ = s.rate_scale;
  engine_->step(state_.step, s);
  ++state_.step;
  state_.lhs_samples += s.points;
  average();
  if (change_ends_ == state_.step) engine_->scene_changed(nullptr, 0.0);
  if (++waiting_ < engine_->steps_between_reports() && !done()) return;
  settle();
  report();
}

void Trainer::Run::report() {
  const double seconds = clock_.seconds();
  state_.seconds = earlier_seconds_ + seconds;
  if (validation_ && seconds >= next_validation_) {
    bring_up_averages();
    untimed([&] { mape_ = validation_->mape(*engine_); });
    if (options_.validated) options_.validated(state_.step, state_.seconds, mape_);
    clock_.back_to(seconds);  // this was no training
    next_validation_ = seconds + between_validations_;
  }
  if (options_.progress && seconds >= next_progress_) {
    options_.progress(progress());
    next_progress_ = seconds + 0.2;
  }
  const bool ends = done() && !was_done_;  // its result is saved; steps after it are not
  was_done_ = done();
  if (seconds >= next_checkpoint_ && !ends) {
    try_checkpoint();
    clock_.back_to(seconds);
    next_checkpoint_ = seconds + config_.checkpoint_seconds;
  }
}

TrainProgress Trainer::Run::progress() const {
  const double seconds = std::max(1e-9, state_.seconds - earlier_seconds_);
  TrainProgress p;
  p.step = state_.step;
  p.steps = config_.train_steps;
  p.seconds = state_.seconds;
  p.fraction = fraction();
  p.rate_scale = rate_scale_;
  p.loss = state_.loss;
  p.validation_mape = mape_;
  p.queries_per_second = static_cast<double>(state_.rhs_queries - first_queries_) / seconds;
  p.points_per_second = static_cast<double>(state_.lhs_samples - first_samples_) / seconds;
  return p;
}

void Trainer::Run::untimed(const std::function<void()>& work) {
  if (waiting_ > 0) settle();
  const double seconds = clock_.seconds();
  work();
  // Of the work. On a stream, steps have a count of their own, and asking for the field would bring all of it back.
  if (options_.stream == nullptr) engine_->field().take_empty_lookups();
  clock_.back_to(seconds);
}

// Factors of the emission of lights.
std::vector<Vec3f> Trainer::Run::emission() const {
  std::vector<Vec3f> factors;
  for (int i = 0; i < scene_.light_count(); ++i) factors.push_back(scene_.light_factor(i));
  return factors;
}

void Trainer::Run::scene_changed(const SceneChange& changed) {
  if (waiting_ > 0) settle();
  SceneChange change = std::exchange(dark_change_, {});
  change += changed;
  validation_.reset();
  mape_ = -1.0;
  const std::vector<Vec3f> now = emission();
  dark_ = std::all_of(now.begin(), now.end(), [](Vec3f f) { return f == Vec3f(0.0f); });
  if (dark_) {
    dark_change_ = change;  // learnt when there is light again
    show_darkness();
    return;
  }
  // What the field stands for, times a factor, is as near as one comes to what it has to stand for.
  double was = 0.0, is = 0.0;
  for (std::size_t i = 0; i < now.size(); ++i) {
    was += static_cast<double>(dot(emission_[i], now[i]));
    is += static_cast<double>(dot(now[i], now[i]));
  }
  const double factor = was > 0.0 ? is / was : 1.0;
  bool same = true;
  for (std::size_t i = 0; i < now.size(); ++i)
    same = same && length(emission_[i] * static_cast<float>(factor) - now[i]) <= 1e-5f * length(now[i]);
  if (same) exposure_ *= factor;
  engine_->set_target_scale(static_cast<float>(exposure_));
  emission_ = now;
  // What arrived before is not what arrives now, nor as bright.
  if (config_.train_guide > 0.0) engine_->set_guide(make_guide(guide_box_, static_cast<float>(exposure_)));
  if (same && !change.materials) return;
  change_began_ = state_.step;
  change_ends_ = state_.step + kChangeSteps;
  auto points = std::make_unique<ChangedPoints>(scene_, lhs_options(config_), change);
  engine_->scene_changed(points->empty() ? nullptr : std::move(points), kChangeShare);
}

TrainResult Trainer::Run::finish(bool interrupted) {
  if (waiting_ > 0) settle();
  TrainResult result;
  result.interrupted = interrupted;
  bring_up_averages();
  save_result(options_.save_optimizer || interrupted);
  if (options_.reference && validation_)
    result.validation_mape =
        Validation::mape_once(scene_.context(), *options_.reference, config_, 1 << 20, 4, *engine_);
  result.steps = state_.step;
  result.seconds = state_.seconds;
  result.lhs_samples = state_.lhs_samples;
  result.rhs_queries = state_.rhs_queries;
  result.loss = state_.loss;
  result.dropped_contributions = dropped_contributions_;
  result.empty_lookups = empty_lookups_;
  result.memory = bytes_;
  result.stages = engine_->stages();
  result.field = engine_->release_field();
  return result;
}

Trainer::Trainer(const PreparedScene& scene, const Config& config, const TrainOptions& options)
    : run_(std::make_unique<Run>(scene, config, options)) {}
Trainer::~Trainer() = default;
void Trainer::step() { run_->step(); }
bool Trainer::done() const { return run_->done(); }
void Trainer::untimed(const std::function<void()>& work) { run_->untimed(work); }
RadianceField& Trainer::field() { return run_->field(); }
const TrainingState& Trainer::state() const { return run_->state(); }
TrainProgress Trainer::progress() const { return run_->progress(); }
const Config& Trainer::config() const { return run_->config(); }
std::vector<SurfacePoint> Trainer::last_points() { return run_->last_points(); }
void Trainer::checkpoint(bool optimizer) { run_->checkpoint(optimizer); }
void Trainer::scene_changed(const SceneChange& change) { run_->scene_changed(change); }
long long Trainer::saved_step() const { return run_->saved_step(); }
const std::string& Trainer::not_saved() const { return run_->not_saved(); }
long long Trainer::change_steps_left() const { return run_->change_steps_left(); }
bool Trainer::is_dark() const { return run_->is_dark(); }
TrainResult Trainer::finish(bool interrupted) { return run_->finish(interrupted); }

TrainResult train(const PreparedScene& scene, const Config& config, const TrainOptions& options) {
  Trainer trainer(scene, config, options);
  while (!trainer.done()) {
    if (options.interrupted && options.interrupted()) return trainer.finish(true);
    trainer.step();
  }
  return trainer.finish(false);
}

}  // namespace octrad
