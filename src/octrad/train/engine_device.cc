// A step is one tiny launch that sets its constants and one recorded graph for its shape of batch (now and then its
// launches one by one, to be timed); nothing is read back until the loop asks for a report. Left-hand-side points do
// not depend on what is learnt: another graph draws them for a group of steps, before the first of the group (or of a
// new shape) that is taken.
#include <algorithm>
#include <functional>
#include <map>
#include <tuple>
#include <utility>

#include "octrad/base/error.h"
#include "octrad/device/array.h"
#include "octrad/device/launch.h"
#include "octrad/model/device_field.h"
#include "octrad/train/engine_device.h"
#include "octrad/transport/device_memory.h"
#include "octrad/transport/direction_guide_device.h"
#include "octrad/transport/lhs_device.h"
#include "octrad/transport/lobes_device.h"
#include "octrad/transport/rhs_device.h"

namespace octrad {
namespace {

// What one step reads, in device memory.
struct StepInput {
  unsigned long long step = 0;
  double by_area = 1.0;
  StepConstants constants;
};

struct SetStep : Kernel {
  StepInput value;
  StepInput* to;
  OCTRAD_HD void operator()(std::uint32_t) const { *to = value; }
};

constexpr int kStepsBetweenReports = kDrawnTogether;
// Now and then, for the first time kTimed steps after the start, a step is launched stage by stage instead of as a
// graph, and timed.
constexpr long long kTimed = 32, kStepsBetweenTimes = 256;
constexpr std::size_t kValidationChunk = std::size_t{1} << 18;  // of radiance(), for validation
constexpr std::size_t kAveragesPoints = std::size_t{1} << 16;   // in flight, of the field of averages

// The most of a number of the schedule that any step has.
std::size_t most_of(const Config& config, int ScheduleState::*number) {
  int most = 0;
  for (const double fraction : kQuarters) most = std::max(most, schedule(config, 0, fraction).*number);
  return static_cast<std::size_t>(most);
}
std::size_t most_points(const Config& config) { return most_of(config, &ScheduleState::points); }
std::size_t most_far_ends(const Config& config) { return most_of(config, &ScheduleState::far_ends); }

using StepShape = std::tuple<int, int, int, int>;  // points, directions, far ends and buffer

// Steps in a group of those with `points` points: enough points to keep a GPU busy, a power of two.
int group_steps(std::size_t points, const DeviceEngineOptions& options) {
  int steps = std::clamp(options.group_steps, 1, kDrawnTogether);
  const auto ahead = static_cast<std::size_t>(options.tuning.points_ahead);
  while (steps > 1 && points * static_cast<std::size_t>(steps) > ahead) steps /= 2;
  return steps;
}

// Points of the largest group.
std::size_t most_points_ahead(const Config& config, const DeviceEngineOptions& options) {
  std::size_t most = 0;
  for (const double fraction : kQuarters) {
    const auto points = static_cast<std::size_t>(schedule(config, 0, fraction).points);
    most = std::max(most, points * static_cast<std::size_t>(group_steps(points, options)));
  }
  return most;
}

// Right-hand-side slots of the largest step, whichever quarter it is in.
std::size_t most_slots(const Config& config) {
  std::size_t most = 0;
  for (const double fraction : kQuarters) {
    const ScheduleState s = schedule(config, 0, fraction);
    most = std::max(most, static_cast<std::size_t>(s.points) * static_cast<std::size_t>(s.directions));
  }
  return most;
}

DeviceFieldOptions field_options(const Config& config, const DeviceEngineOptions& options) {
  DeviceFieldOptions field;
  field.max_points = std::min(most_slots(config), static_cast<std::size_t>(options.tuning.query_chunk));
  field.tuning = options.tuning;
  field.max_train_points = most_points(config);
  field.deterministic = options.deterministic;
  field.half_features = options.half_features;
  return field;
}

// Of the averages: only validation asks them on the device.
DeviceFieldOptions averages_options(const Config& config, const DeviceEngineOptions& options) {
  DeviceFieldOptions averages = field_options(config, options);
  averages.max_points = std::min(averages.max_points, kAveragesPoints);
  averages.max_train_points = 0;
  averages.averages = true;
  return averages;
}

class DeviceEngine : public TrainEngine {
 public:
  DeviceEngine(Stream& stream, const PreparedScene& scene, const Config& config, const LhsSampler& sampler,
               std::unique_ptr<RadianceField> field, std::unique_ptr<RadianceField> averages,
               const DeviceEngineOptions& options)
      : stream_(stream),
        times_(stream),
        config_(config),
        options_(options),
        ahead_(options.tuning.draw_ahead ? stream.sibling() : nullptr),
        draw_times_(ahead_ ? *ahead_ : stream),
        lhs_(stream, scene.world(stream), lhs_options(config), sampler.views(), sampler.fresh_poses(),
             most_points(config), most_points_ahead(config, options), -1, ahead_.get(),
             query_rays(config, true).offset),
        lobes_(stream, scene.world(stream), most_points(config), query_rays(config, true), false),
        rhs_(stream, scene.world(stream), most_slots(config), query_rays(config), config.train_guide > 0.0),
        rhs_options_(rhs_rules(config)),
        field_(std::move(field)),
        device_field_(make_device_field(stream, *field_, config, field_options(config, options))),
        averages_(std::move(averages)),
        device_averages_(averages_ ? make_device_field(stream, *averages_, config, averages_options(config, options))
                                   : nullptr),
        input_(stream, 1, "a step's constants"),
        ahead_input_(stream, 1, "a step's constants"),
        responses_(stream, most_slots(config), "responses of the cache"),
        targets_(stream, most_points(config), "targets"),
        far_ends_(stream, most_far_ends(config), "far ends") {
    set_far_ends({});
    rhs_options_.own_emission = rhs_options_.emission_inside;
    rhs_options_.seed = static_cast<unsigned long long>(config.seed);
  }
  // Recorded graphs must not end while they run, as after an interruption.
  ~DeviceEngine() override {
    for (Stream* stream : {&stream_, ahead_.get()}) {
      try {
        if (stream != nullptr) stream->synchronize();
      } catch (const Error&) {  // the device is lost: nothing runs
      }
    }
  }

  void step(long long step, const ScheduleState& s) override {
    StepInput input;
    by_area_ = s.by_area;
    input.step = static_cast<unsigned long long>(step);
    input.by_area = by_area(step);
    input.constants = {static_cast<float>(s.epsilon), static_cast<float>(s.rate_scale),
                       static_cast<float>(s.network_scale)};
    launch(stream_, 1, SetStep{{}, input, input_.data()});
    last_points_ = static_cast<std::size_t>(s.points);
    // Where batches grow, what lies beyond the last step's ends is of steps before it.
    if (static_cast<std::size_t>(s.far_ends) > kept_ends_) set_far_ends(far_ends());
    kept_ends_ = static_cast<std::size_t>(s.far_ends);
    stale_ = true;
    if (guide_ && step % kGuideSteps == 0) guide_->make_tables();
    if (next_timed_ < 0) next_timed_ = step + kTimed;
    const StepShape shape{s.points, s.directions, s.far_ends, buffer_of(step)};
    // Only where a group begins, and once both graphs are there: neither recording nor setting up is part of a step.
    if (step >= next_timed_ && step % kStepsBetweenReports == 0 && is_recorded(step_graphs_, shape) &&
        is_recorded(draw_graphs_, std::pair{last_points_, buffer_of(step)})) {
      next_timed_ = step + kStepsBetweenTimes;
      settle_times();
      draw_group(step, false);
      times_.begin();
      run(s, buffer_of(step));
      times_.end();
      return;
    }
    draw_group(step);
    run_or_replay(stream_, step_graphs_, shape, [&] { run(s, std::get<3>(shape)); });
  }

  int steps_between_reports() const override { return kStepsBetweenReports; }

  StepReport collect() override {
    if (ahead_) ahead_->synchronize();  // an edit of the scene may follow
    DeviceTrainReport trained = device_field_->collect();
    settle_times();
    const TraceCounts traced = rhs_.take_counts();
    if (lhs_.take_missing() > 0) throw InputError(no_lhs_point());
    StepReport report;
    report.losses = std::move(trained.losses);
    report.rhs_queries = static_cast<long long>(traced.queries);
    report.dropped = static_cast<long long>(traced.non_finite);
    report.non_finite = trained.non_finite;
    report.empty_lookups = device_field_->take_empty_lookups();
    return report;
  }

  StageSplit stages() const override {
    StageSplit split = draw_times_.means();
    for (const auto& [stage, ms] : times_.means()) {
      const auto known = std::ranges::find(split, stage, [](const auto& s) { return s.first; });
      if (known != split.end()) known->second += ms;  // part of it is drawn, part of it the step's own
      else split.emplace_back(stage, ms);
    }
    return split;
  }

  void radiance(std::span<const SurfacePoint> points, std::span<Vec3f> out) override {
    const QueryRays rays = query_rays(config_);
    if (query_points_.stride() == 0) {
      query_points_ = PlaneArray(stream_, surface_point_numbers(rays), kValidationChunk, "validation points");
      query_radiance_ = DeviceArray<Vec3f>(stream_, kValidationChunk, "validation points");
    }
    const std::size_t stride = query_points_.stride();
    std::vector<float> planes(static_cast<std::size_t>(surface_point_numbers(rays)) * stride);
    const SurfacePointArray host = surface_point_array(planes.data(), stride, rays),
                            there = surface_point_array(query_points_.points().data, stride, rays);
    for (std::size_t begin = 0; begin < points.size(); begin += kValidationChunk) {
      const std::size_t n = std::min(kValidationChunk, points.size() - begin);
      for (std::size_t i = 0; i < n; ++i) host.store_all(i, points[begin + i]);
      stream_.upload(there.data, planes.data(), planes.size() * sizeof(float));
      (device_averages_ ? device_averages_ : device_field_)->radiance(there, nullptr, n, query_radiance_.data());
      query_radiance_.download(out.subspan(begin, n));
    }
  }

  RadianceField& field() override {
    if (!averages_) return up_to_date();
    if (averages_stale_) device_averages_->download_to(*averages_);
    averages_stale_ = false;
    return *averages_;
  }
  std::unique_ptr<RadianceField> release_field() override {
    field();
    return std::move(averages_ ? averages_ : field_);
  }
  RadianceField* trained() override { return averages_ ? &up_to_date() : nullptr; }
  void average(double share) override {
    if (!averages_) return;
    device_averages_->approach(*device_field_, static_cast<float>(share));
    averages_stale_ = true;
  }

  std::vector<FarEnd> far_ends() override {
    std::vector<FarEnd> ends(kept_ends_);
    far_ends_.download(std::span<FarEnd>(ends));
    return ends;
  }
  void set_far_ends(const std::vector<FarEnd>& ends) override {
    std::vector<FarEnd> all(far_ends_.size());
    kept_ends_ = std::min(ends.size(), all.size());
    std::copy_n(ends.begin(), kept_ends_, all.begin());
    far_ends_.upload(std::span<const FarEnd>(all));
  }

  GuideState guide() override { return guide_ ? guide_->download() : GuideState(); }
  void set_guide(const GuideState& guide) override {
    stream_.synchronize();
    guide_ = guide.empty() ? nullptr
                           : std::make_unique<DeviceGuide>(stream_, guide, static_cast<float>(config_.train_guide));
    rhs_options_.guides = guide_ ? guide_->view() : GuideView();
    rhs_options_.epsilon = &input_.data()->constants.epsilon;
    step_graphs_.clear();  // they know another one
  }

  void set_target_scale(float scale) override {
    device_field_->set_target_scale(scale);
    field_->set_target_scale(scale);
    if (!averages_) return;
    device_averages_->set_target_scale(scale);
    averages_->set_target_scale(scale);
  }
  // Points are drawn as always; those that were drawn ahead know the old materials.
  void scene_changed(std::unique_ptr<ChangedPoints>, double) override { drawn_ = next_ = {}; }

  void last_batch(std::vector<SurfacePoint>& points, std::vector<Vec3f>& targets) override {
    points = download_points(stream_, training_points(), last_points_);
    targets.resize(last_points_);
    targets_.download(std::span<Vec3f>(targets));
  }

 private:
  template <typename Key>
  using Graphs = std::map<Key, std::unique_ptr<LaunchGraph>>;

  // Work of a key runs as it is for the first time (what is set up once must not be recorded), then as a graph.
  template <typename Key>
  void run_or_replay(Stream& stream, Graphs<Key>& graphs, const Key& key, const std::function<void()>& work) {
    const auto [entry, first] = graphs.try_emplace(key);
    if (first) {
      work();
      return;
    }
    if (!entry->second) entry->second = stream.capture(work);
    stream.replay(*entry->second);
  }
  template <typename Key>
  static bool is_recorded(const Graphs<Key>& graphs, const Key& key) {
    const auto found = graphs.find(key);
    return found != graphs.end() && found->second;
  }

  RadianceField& up_to_date() {
    if (stale_) device_field_->download_to(*field_);
    stale_ = false;
    return *field_;
  }

  SurfacePointArray training_points() const {
    SurfacePointArray points = lhs_.surface_points();
    points.lobe = lobes_.clusters();
    return points;
  }

  long long group_of(long long step) const { return step / group_steps(last_points_, options_); }
  // Where the points of the step's group are: groups take turns where they are drawn ahead.
  int buffer_of(long long step) const { return ahead_ ? static_cast<int>(group_of(step) % 2) : 0; }

  // Of a step that may be drawn before its time: where the budget is in seconds, that of the last step.
  double by_area(long long step) const {
    return config_.train_steps > 0 ? schedule(config_, step, 0.0).by_area : by_area_;
  }

  // Left-hand-side points of the step's group, unless they are there. Points drawn for another shape are no longer.
  // `graph`: replayed, else launch by launch and timed, with nothing beside it. Where points are drawn ahead, a sibling
  // of the stream draws the next group while this one is taken from.
  void draw_group(long long step, bool graph = true) {
    const std::pair<std::size_t, long long> group{last_points_, group_of(step)};
    if (group == drawn_) return;
    if (!ahead_) {
      draw(stream_, input_.data(), step, graph);
      drawn_ = group;
      return;
    }
    if (group != next_) draw_beside(step);
    stream_.wait(*ready_);
    drawn_ = group;
    draw_beside((group.second + 1) * group_steps(last_points_, options_), graph);
    if (!graph) stream_.wait(*ready_);
    next_ = {last_points_, group.second + 1};
  }
  // After what the stream has been asked for so far, which may still take from the buffer.
  void draw_beside(long long step, bool graph = true) {
    const auto before = stream_.record();
    ahead_->wait(*before);
    StepInput input;
    input.step = static_cast<unsigned long long>(step);
    input.by_area = by_area(step);
    launch(*ahead_, 1, SetStep{{}, input, ahead_input_.data()});
    draw(*ahead_, ahead_input_.data(), step, graph);
    ready_ = ahead_->record();
  }
  void draw(Stream& stream, const StepInput* input, long long step, bool graph) {
    const int steps = group_steps(last_points_, options_), buffer = buffer_of(step);
    const auto work = [&] { lhs_.draw(&input->step, last_points_, steps, buffer, &input->by_area); };
    if (graph) {
      run_or_replay(stream, draw_graphs_, std::pair{last_points_, buffer}, work);
      return;
    }
    draw_times_.begin();
    draw_times_.set_share(1.0 / steps);
    work();
    draw_times_.end();
  }

  void settle_times() {
    draw_times_.settle();
    times_.settle();
  }

  void run(const ScheduleState& s, int buffer) {
    const auto n = static_cast<std::size_t>(s.points);
    const auto far_ends = static_cast<std::size_t>(s.far_ends);
    lhs_.take(&input_.data()->step, n, group_steps(n, options_), buffer);
    if (far_ends > 0) lhs_.take_far_ends(far_ends_.data(), far_ends);
    lobes_.trace(lhs_.surface_points(), lhs_.points(), rhs_options_.seed, &input_.data()->step, n);
    stream_.mark("left-hand rest");
    rhs_options_.directions = s.directions;
    rhs_options_.far_ends = far_ends_.data();
    rhs_options_.far_end_count = static_cast<std::uint32_t>(far_ends);
    const DeviceRhsPoints points{lhs_.points(), nullptr, n, &input_.data()->step, nullptr};
    rhs_.trace(points, rhs_options_);
    device_field_->radiance(rhs_.queries(), rhs_.query_count(), n * static_cast<std::size_t>(s.directions),
                            responses_.data());
    rhs_.reduce(points, rhs_options_, responses_.data(), targets_.data());
    device_field_->train(training_points(), targets_.data(), n, &input_.data()->constants);
  }

  Stream& stream_;
  StageTimes times_;
  long long next_timed_ = -1;  // step; below 0 before the first
  double by_area_ = 1.0;       // of the last step
  const Config config_;
  const DeviceEngineOptions options_;
  std::unique_ptr<Stream> ahead_;  // draws left-hand-side points; null: stream_ does
  StageTimes draw_times_;          // of that
  DeviceLhs lhs_;
  DeviceLobes lobes_;  // of left-hand-side points
  DeviceRhs rhs_;
  DeviceRhsOptions rhs_options_;
  std::unique_ptr<RadianceField> field_;
  std::unique_ptr<DeviceField> device_field_;
  std::unique_ptr<RadianceField> averages_;  // null: none
  std::unique_ptr<DeviceField> device_averages_;
  bool stale_ = false, averages_stale_ = false;  // field_ or averages_ lacks what the device learnt since
  DeviceArray<StepInput> input_, ahead_input_;
  DeviceArray<Vec3f> responses_, targets_;
  DeviceArray<FarEnd> far_ends_;        // of the last step
  std::unique_ptr<DeviceGuide> guide_;  // null: directions are drawn by the BSDF alone
  std::size_t last_points_ = 0, kept_ends_ = 0;
  std::pair<std::size_t, long long> drawn_;          // points a step and number of the group that is taken from
  std::pair<std::size_t, long long> next_;           // that ahead_ has drawn, or draws
  std::unique_ptr<StreamEvent> ready_;               // when it has
  Graphs<std::pair<std::size_t, int>> draw_graphs_;  // by points of a step and buffer
  Graphs<StepShape> step_graphs_;
  PlaneArray query_points_;
  DeviceArray<Vec3f> query_radiance_;
};

}  // namespace

std::vector<MemoryPart> estimate_device_training(const Config& config, const std::vector<long long>& cells_per_level,
                                                 const DeviceEngineOptions& options) {
  std::vector<MemoryPart> parts = estimate_device_memory(config, cells_per_level, field_options(config, options));
  if (config.train_average > 0.0) {
    for (MemoryPart& part : estimate_device_memory(config, cells_per_level, averages_options(config, options)))
      parts.push_back({"averages: " + part.name, part.bytes});
  }
  const std::size_t slots = most_slots(config), points = most_points(config);
  parts.push_back({"rays and queries of a step", DeviceRhs::bytes(slots, query_rays(config), config.train_guide > 0.0) +
                                                     (config.train_guide > 0.0 ? kGuideBytes : 0) +
                                                     slots * sizeof(Vec3f)});
  parts.push_back(
      {"left-hand-side points", DeviceLhs::bytes(points, most_points_ahead(config, options),
                                                 options.tuning.draw_ahead ? 2 : 1, query_rays(config).offset) +
                                    DeviceLobes::bytes(points, query_rays(config, true), false) +
                                    points * sizeof(Vec3f) + most_far_ends(config) * sizeof(FarEnd)});
  return parts;
}

std::unique_ptr<TrainEngine> make_device_engine(Stream& stream, const PreparedScene& scene, const Config& config,
                                                const LhsSampler& sampler, std::unique_ptr<RadianceField> field,
                                                std::unique_ptr<RadianceField> averages,
                                                const DeviceEngineOptions& options) {
  return std::make_unique<DeviceEngine>(stream, scene, config, sampler, std::move(field), std::move(averages), options);
}

}  // namespace octrad
