// Training on a stream against training on the CPU: the same loop, the same random numbers.
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <set>
#include <string>
#include <string_view>

#include "octrad/base/error.h"
#include "octrad/base/sanitized_test_helper.h"
#include "octrad/device/stream_test_helper.h"
#include "octrad/device/tuning_keys.h"
#include "octrad/train/batch.h"
#include "octrad/train/box_test_helper.h"
#include "octrad/train/checks.h"
#include "octrad/train/engine_device.h"
#include "octrad/train/narrow_networks_test_helper.h"
#include "octrad/train/schedule.h"
#include "octrad/train/trainer.h"

namespace octrad {
namespace {

using testing::Box;

Config short_run(const std::string& field, int steps) {
  Config config = preset("cpu");
  config.field = field;
  config.train_steps = steps;
  config.train_points = 256;
  config.train_directions = 4;
  config.octree_levels = 3;
  config.disparity_log2_table = 10;
  config.nr_log2_table = config.ncr_log2_table = config.ncr_cone_log2_table = 12;
  config.ncr_rays_train = 16;
  config.ncr_rays_render = 8;
  testing::narrow_networks(config);
  config.adam_warmup = 1;
  config.train_far_ends = 0.3;
  return config;
}

std::vector<Vec3f> radiance(const RadianceField& field, std::span<const SurfacePoint> points) {
  std::vector<Vec3f> out(points.size());
  field.radiance(points, out);
  return out;
}

std::string temporary(const std::string& name) {
  return (std::filesystem::temp_directory_path() / ("octrad_device_" + std::to_string(::getpid()) + "_" + name))
      .string();
}

class TrainOnStream : public testing::StreamTest {
 protected:
  Box box;
  const std::vector<SurfacePoint> probes_ = surface_probes(box.scene, 400, 1, short_run("ncr", 1));
};

TEST_P(TrainOnStream, LearnsWhatTheCpuLearns) {
  if (testing::sanitized()) GTEST_SKIP() << "takes half a minute under the sanitizers; shorter runs are the same loop";
  for (const char* field : {"octaoctree", "nr", "ncr"}) {
    Config config = short_run(field, 80);  // the last of them guided
    config.train_points = 128;
    config.adam_decay_start = 0.9;  // before, all steps have the same shape: only such are timed
    const TrainingPair pair = train_on_both(*stream, box.scene, config, probes_);
    const TrainResult &on_stream = pair.on_stream, &on_cpu = pair.on_cpu;
    EXPECT_EQ(on_stream.steps, on_cpu.steps);
    EXPECT_EQ(on_stream.lhs_samples, on_cpu.lhs_samples);
    EXPECT_TRUE(on_cpu.stages.empty());
    for (const char* wanted : {"left-hand rays", "occlusion rays", "closest-hit rays", "hits", "look-up", "decoder",
                               "targets", "training forward", "decoder backward", "tables' optimiser"}) {
      const auto found = std::ranges::find(on_stream.stages, wanted, [](const auto& s) { return s.first; });
      ASSERT_NE(found, on_stream.stages.end()) << wanted;
    }
    double step_ms = 0.0;
    std::set<std::string> names;
    for (const auto& [stage, ms] : on_stream.stages) {
      EXPECT_GE(ms, 0.0) << stage;
      EXPECT_TRUE(names.insert(stage).second) << stage << " twice";
      step_ms += ms;
    }
    EXPECT_GT(step_ms, 0.0);
    EXPECT_LT(step_ms, 1e3 * on_stream.seconds);
    // The same paths but where rounding sends a ray another way.
    EXPECT_NEAR(static_cast<double>(on_stream.rhs_queries), static_cast<double>(on_cpu.rhs_queries),
                1e-3 * static_cast<double>(on_cpu.rhs_queries));
    // On the host .0002 of the loss at most, and of radiance .0011 (octaoctree), .0006 (nr) and .003 (ncr): the order
    // in which threads and lanes add to a table is theirs.
    RecordProperty(std::string("loss_difference_") + field, std::to_string(pair.loss_difference));
    RecordProperty(std::string("difference_") + field, std::to_string(pair.difference));
    EXPECT_LT(pair.loss_difference, 0.05) << field;
    EXPECT_LT(pair.difference, 0.05) << field;
    // And it is something: not what an untrained field says.
    const TrainResult untrained = train(box.scene, short_run(field, 1), TrainOptions{});
    EXPECT_GT(mean_difference(*untrained.field, *on_cpu.field, probes_), 0.3) << field;
  }
}

TEST_P(TrainOnStream, StagesAreTimedAfterThirtyTwoSteps) {
  TrainOptions options;
  options.stream = stream.get();
  Config config = short_run("octaoctree", 32);
  config.adam_decay_start = 1.0;  // all steps have the same shape
  EXPECT_TRUE(train(box.scene, config, options).stages.empty());
  config.train_steps = 33;
  EXPECT_GE(train(box.scene, config, options).stages.size(), 15u);
}

TEST_P(TrainOnStream, DeterministicRunsRepeatBitForBit) {
  TrainOptions options;
  options.stream = stream.get();
  options.deterministic = true;
  for (const char* field : {"octaoctree", "ncr"}) {
    if (testing::sanitized() && std::string_view(field) == "ncr") break;  // the loop is the same
    const Config config = short_run(field, 20);
    const std::vector<Vec3f> a = radiance(*train(box.scene, config, options).field, probes_),
                             b = radiance(*train(box.scene, config, options).field, probes_);
    for (std::size_t i = 0; i < a.size(); ++i) ASSERT_EQ(a[i], b[i]) << field << " " << i;
  }
}

// However many steps' left-hand-side points are drawn at once, and wherever a run begins, changes its shape or asks for
// a report.
class PointsDrawnAhead : public TrainOnStream {
 protected:
  void are_those_of_the_step(const Config& config);
};

void PointsDrawnAhead::are_those_of_the_step(const Config& config) {
  const FieldDomain domain = field_domain(box.scene.scene(), config, fit_domain(box.scene, config).box);
  BatchSource batches(box.scene, config, {});
  std::vector<Vec3f> learnt[5], last_targets[5];
  std::vector<SurfacePoint> last_points[5];
  const int groups[] = {1, 4, 16, 4, 16};
  for (int k = 0; k < 5; ++k) {
    DeviceEngineOptions options;
    options.deterministic = true;
    options.group_steps = groups[k];
    options.tuning.draw_ahead = k > 2;
    auto engine =
        make_device_engine(*stream, box.scene, config, batches.sampler(), make_field(config, domain), nullptr, options);
    for (long long step = 3; step < 24; ++step) {
      engine->step(step, schedule(config, step, static_cast<double>(step) / 24.0));
      if (step == 9) {
        EXPECT_EQ(engine->collect().losses.size(), 7u);
      }
    }
    EXPECT_EQ(engine->collect().losses.size(), 14u);
    engine->last_batch(last_points[k], last_targets[k]);
    learnt[k] = radiance(*engine->release_field(), probes_);
  }
  // The last batch is the last step's.
  const ScheduleState s = schedule(config, 23, 23.0 / 24.0);
  ASSERT_EQ(last_points[0].size(), static_cast<std::size_t>(s.points));
  batches.draw(23, s, nullptr);
  std::size_t same = 0;
  const auto far_ends = static_cast<std::size_t>(s.far_ends);  // of the step before
  for (std::size_t i = far_ends; i < last_points[0].size(); ++i)
    same += length(batches.points()[i].x - last_points[0][i].x) < 1e-3f;
  EXPECT_GT(same, (last_points[0].size() - far_ends) * 9 / 10);
  for (const int k : {1, 2, 3, 4}) {
    EXPECT_TRUE(learnt[k] == learnt[0]) << groups[k] << " steps at once" << (k > 2 ? ", on another stream" : "");
    EXPECT_TRUE(last_targets[k] == last_targets[0]);
    for (std::size_t i = 0; i < last_points[0].size(); ++i) ASSERT_EQ(last_points[k][i].x, last_points[0][i].x);
  }
}

TEST_P(PointsDrawnAhead, WhereBatchesShrink) {
  Config config = short_run("octaoctree", 24);
  config.train_points = 128;
  config.train_directions = 1;
  config.train_quarters = true;
  are_those_of_the_step(config);
}
TEST_P(PointsDrawnAhead, WhereBatchesGrow) {
  Config config = short_run("octaoctree", 24);
  config.train_first_points = 64;
  config.train_directions = 2;
  are_those_of_the_step(config);
}

TEST_P(TrainOnStream, AnotherEngineGoesOnWhereBatchesGrow) {
  Config config = short_run("octaoctree", 24);
  config.train_first_points = 64;
  config.train_directions = 2;
  const FieldDomain domain = field_domain(box.scene.scene(), config, fit_domain(box.scene, config).box);
  BatchSource batches(box.scene, config, {});
  DeviceEngineOptions options;
  options.deterministic = true;
  const auto at = [&](int step) { return schedule(config, step, step / 24.0); };
  const auto engine = [&](std::unique_ptr<RadianceField> field) {
    return make_device_engine(*stream, box.scene, config, batches.sampler(), std::move(field), nullptr, options);
  };
  const auto take = [&](TrainEngine& of, int begin, int end) {
    for (int step = begin; step < end; ++step) of.step(step, at(step));
    of.collect();
  };
  const auto whole = engine(make_field(config, domain)), first = engine(make_field(config, domain));
  take(*whole, 0, 24);
  take(*first, 0, 12);
  const std::vector<FarEnd> ends = first->far_ends();
  EXPECT_LT(ends.size(), static_cast<std::size_t>(at(12).far_ends));
  EXPECT_LT(ends.size(), static_cast<std::size_t>(at(6).far_ends));  // so that there are older ones behind them
  const auto second = engine(first->release_field());
  second->set_far_ends(ends);
  take(*second, 12, 24);
  EXPECT_TRUE(radiance(*second->release_field(), probes_) == radiance(*whole->release_field(), probes_));
}

// Every alternative of DeviceTuning learns the same.
TEST_P(TrainOnStream, TuningChangesNothing) {
  for (const bool dense : {false, true}) {
    Config config = short_run("octaoctree", testing::sanitized() ? 6 : 20);
    config.train_points = 128;
    config.train_directions = 2;
    config.adam_mode = dense ? AdamMode::dense : AdamMode::touched;
    TrainOptions options;
    options.stream = stream.get();
    options.deterministic = true;
    const auto learnt = [&] { return radiance(*train(box.scene, config, options).field, probes_); };
    stream->tuning = {};
    const std::vector<Vec3f> expected = learnt();
    for (const auto& [key, value] : {std::pair{"scan_touched", "0"},
                                     {"query_chunk", "100"},
                                     {"points_ahead", "64"},
                                     {"draw_ahead", "0"},
                                     {"lhs_rounds", "1"},
                                     {"cast_dynamic", "0"},
                                     {"cast_warps", "1"},
                                     {"cast_refill", "32"},
                                     {"block", "64"}}) {
      stream->tuning = {};
      set(stream->tuning, key, value);
      // Other kernels finish the points then, in which a GPU's compiler fuses other products and sums.
      if (!stream->on_device() || std::string_view(key) != "lhs_rounds") {
        EXPECT_TRUE(learnt() == expected) << key << "=" << value;
      }
      if (dense) break;
    }
  }
  stream->tuning = {};
}

// The one key that rounds.
TEST_P(TrainOnStream, HalfMomentsLearnTheSame) {
  Config config = short_run("octaoctree", 60);
  config.train_points = 128;
  config.train_directions = 2;
  config.adam_mode = AdamMode::dense;
  config.adam_beta2 = 0.999;
  TrainOptions options;
  options.stream = stream.get();
  options.deterministic = true;
  const auto floats = train(box.scene, config, options);
  stream->tuning.half_moments = true;
  const auto halves = train(box.scene, config, options);
  stream->tuning = {};
  const double difference = mean_difference(*halves.field, *floats.field, probes_);
  EXPECT_GT(difference, 0.0);
  EXPECT_LT(difference, 0.05);
}

TEST_P(TrainOnStream, RunsContinueOnTheOtherDevice) {
  for (const auto& [field, starts_on_cpu] :
       {std::pair{"octaoctree", true}, {"octaoctree", false}, {"ncr", true}, {"ncr", false}}) {
    if (testing::sanitized() && std::string_view(field) == "ncr") break;  // the loop is the same
    Config config = short_run(field, 200);                                // averages are no longer the weights
    config.train_average = 0.5;
    config.adam_decay_to = 0.8;
    config.train_points = 64;
    config.train_directions = 2;
    const TrainResult whole = train(box.scene, config, TrainOptions{});
    TrainOptions options;
    options.output = temporary("moves.octrad");
    options.deterministic = true;  // what is compared is what is passed on, not the order of sums
    options.stream = starts_on_cpu ? nullptr : stream.get();
    int asked = 0;
    options.interrupted = [&] { return ++asked > 150; };
    EXPECT_TRUE(train(box.scene, config, options).interrupted);
    Model model = load_model(options.output, true);
    EXPECT_EQ(model.info.state.step, 150);
    ASSERT_TRUE(model.has_optimizer);
    EXPECT_GT(mean_difference(*model.field, *model.trained, probes_), 1e-3);
    options.interrupted = nullptr;
    options.resume = &model;
    options.stream = starts_on_cpu ? stream.get() : nullptr;
    const TrainResult result = train(box.scene, model.info.config, options);
    EXPECT_EQ(result.steps, 200);
    const double difference = mean_difference(*result.field, *whole.field, probes_);
    RecordProperty(std::string("difference_") + field + (starts_on_cpu ? "_from_cpu" : "_to_cpu"),
                   std::to_string(difference));
    EXPECT_LT(difference, 0.05) << field;  // on the host .006 at most
    std::filesystem::remove(options.output);
  }
}

TEST_P(TrainOnStream, MemoryIsEstimatedBeforeItIsTaken) {
  TrainOptions options;
  options.stream = stream.get();
  options.max_memory = 1e6;
  try {
    train(box.scene, short_run("octaoctree", 5), options);
    FAIL() << "1 MB was enough";
  } catch (const MemoryError& error) {
    EXPECT_NE(std::string(error.what()).find("octree.levels=2"), std::string::npos) << error.what();
  }
  EXPECT_EQ(stream->peak_bytes(), 0u);
  for (const char* field : {"octaoctree", "ncr"}) {
    const auto fresh = GetParam() ? make_cuda_stream(0) : make_host_stream();
    options.stream = fresh.get();
    options.max_memory = 0.0;
    const double estimate = train(box.scene, short_run(field, 20), options).memory;
    EXPECT_GT(estimate, 0.8 * static_cast<double>(fresh->peak_bytes())) << field;
    EXPECT_LT(estimate, 1.3 * static_cast<double>(fresh->peak_bytes())) << field;
    box.scene.release(*fresh);
  }
}

INSTANTIATE_TEST_SUITE_P(All, TrainOnStream, ::testing::Bool(), testing::stream_name);
INSTANTIATE_TEST_SUITE_P(All, PointsDrawnAhead, ::testing::Bool(), testing::stream_name);

}  // namespace
}  // namespace octrad
