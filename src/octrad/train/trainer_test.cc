// The training loop: resuming, interruption, memory, failure. What it learns is tested in learning_test.cc.
#include <gtest/gtest.h>
#include <unistd.h>

#include <chrono>
#include <cmath>
#include <filesystem>
#include <map>
#include <numeric>
#include <thread>

#include "octrad/base/error.h"
#include "octrad/base/sanitized_test_helper.h"
#include "octrad/base/threads.h"
#include "octrad/model/safetensors.h"
#include "octrad/train/box_test_helper.h"
#include "octrad/train/checks.h"
#include "octrad/train/narrow_networks_test_helper.h"
#include "octrad/train/schedule.h"
#include "octrad/train/trainer.h"

namespace octrad {
namespace {

using testing::Box;

Config short_run(int steps, const std::string& field = "octaoctree") {
  Config config = preset("cpu");
  config.field = field;
  config.train_steps = steps;
  config.train_points = 64;
  config.train_directions = 2;
  config.octree_levels = 3;
  config.disparity_log2_table = 10;
  config.nr_log2_table = config.ncr_log2_table = config.ncr_cone_log2_table = 10;
  config.ncr_rays_train = 16;
  testing::narrow_networks(config);
  config.train_poses = 8;
  config.train_far_ends = 0.5;
  return config;
}

// Under the sanitizers one: there they take ten times as long, and the loop is the same.
std::vector<std::string> looped_fields() {
  return testing::sanitized() ? std::vector<std::string>{"octaoctree"} : field_names();
}

std::string temporary(const std::string& name) {
  return (std::filesystem::temp_directory_path() / ("octrad_" + std::to_string(::getpid()) + "_" + name)).string();
}

// Every tensor of two files is equal, bit by bit.
void expect_same_tensors(const std::string& a, const std::string& b) {
  const TensorReader first(a), second(b);
  ASSERT_EQ(first.names(), second.names());
  for (const std::string& name : first.names()) {
    const auto x = first.get(name), y = second.get(name);
    ASSERT_EQ(x.bytes, y.bytes) << name;
    std::vector<char> one(x.bytes), other(y.bytes);
    first.read(x, one.data());
    second.read(y, other.data());
    EXPECT_TRUE(one == other) << name << " differs";
  }
}

TEST(Train, ResumedRunEndsWithTheBitsOfAnUnbrokenOne) {
  Box box;
  // Long enough that averages are no longer the weights, and so short that they are.
  for (const auto& [steps, stop] : {std::pair{12, 5}, std::pair{200, 150}}) {
    for (const std::string& field : looped_fields()) {
      SCOPED_TRACE(field);
      const std::string whole = temporary("whole.octrad"), broken = temporary("broken.octrad");
      Config config = short_run(steps, field);
      config.train_average = 0.5;
      config.adam_decay_to = 0.8;  // averages last
      TrainOptions options;
      options.output = whole;
      const double loss = train(box.scene, config, options).loss;

      options.output = broken;
      int taken = 0;
      options.interrupted = [&, stop = stop] { return ++taken > stop; };
      EXPECT_TRUE(train(box.scene, config, options).interrupted);
      Model model = load_model(broken, true);
      EXPECT_EQ(model.info.state.step, stop);
      ASSERT_TRUE(model.has_optimizer);
      options.interrupted = nullptr;
      options.resume = &model;
      const TrainResult result = train(box.scene, model.info.config, options);
      EXPECT_EQ(result.steps, steps);
      EXPECT_EQ(result.loss, loss);  // its smoothing continues too
      expect_same_tensors(whole, broken);
      std::filesystem::remove(whole);
      std::filesystem::remove(broken);
    }
  }
}

// Of the arrays that a field names, as the file of a run has them.
std::map<std::string, std::vector<double>> weights_in(const std::string& file, bool trained) {
  const Model model = load_model(file, true);
  std::map<std::string, std::vector<double>> result;
  for (const WeightArray& array : (trained ? model.trained : model.field)->weights())
    result[array.name].assign(array.values.begin(), array.values.end());
  return result;
}

TEST(Train, WhatIsSavedIsARunningMeanOfTheWeights) {
  Box box;
  const std::string file = temporary("averages.octrad"), plain = temporary("plain.octrad");
  for (const std::string& field : looped_fields()) {
    SCOPED_TRACE(field);
    Config config = short_run(400, field);
    config.train_average = 0.25;
    config.adam_decay_start = 1.0;
    TrainOptions options;
    options.output = file;
    Trainer trainer(box.scene, config, options);
    std::map<std::string, std::vector<double>> mean;
    int looks = 0;
    while (!trainer.done()) {
      trainer.step();
      const long long step = trainer.state().step;
      const double share = average_share(config, step, 1.0);
      if (share >= 1.0 || (share <= 0.0 && !mean.empty())) continue;
      trainer.checkpoint(true);
      const auto weights = weights_in(file, true);
      if (mean.empty()) mean = weights;
      for (auto& [name, values] : mean) {
        for (std::size_t i = 0; i < values.size(); ++i) values[i] += share * (weights.at(name)[i] - values[i]);
      }
      looks += share > 0.0;
    }
    EXPECT_EQ(looks, 2);  // after 320 and 384 steps
    trainer.finish(false);
    const auto saved = weights_in(file, false), last = weights_in(file, true);
    double apart = 0.0;
    for (const auto& [name, values] : mean) {
      for (std::size_t i = 0; i < values.size(); ++i) {
        // Rims are not looked up and stay 0 while a field learns; files have what other vertices of the map have.
        if (name == "octree.features" && last.at(name)[i] == 0.0) continue;
        ASSERT_NEAR(saved.at(name)[i], values[i], 2e-6 * std::max(1.0, std::abs(values[i]))) << name << ' ' << i;
        apart = std::max(apart, std::abs(saved.at(name)[i] - last.at(name)[i]));
      }
    }
    EXPECT_GT(apart, 1e-4);  // they are not the weights

    // Steps do not notice, nor does it matter who looks and when.
    config.train_average = 0.0;
    options.output = plain;
    train(box.scene, config, options);
    for (const auto& [name, values] : weights_in(plain, false)) {
      for (std::size_t i = 0; i < values.size(); ++i) {
        if (name == "octree.features" && last.at(name)[i] == 0.0) continue;  // a rim, or untouched
        ASSERT_EQ(last.at(name)[i], values[i]) << name << ' ' << i;
      }
    }
    const TensorReader with(file), without(plain);
    for (const std::string& name : without.names()) {
      if (!name.starts_with("optimizer.")) continue;
      std::vector<char> one(with.get(name).bytes), other(without.get(name).bytes);
      with.read(with.get(name), one.data());
      without.read(without.get(name), other.data());
      EXPECT_TRUE(one == other) << name;
    }
    config.train_average = 0.25;
    train(box.scene, config, options);
    expect_same_tensors(file, plain);
  }
  std::filesystem::remove(file);
  std::filesystem::remove(plain);
}

TEST(Train, ACheckpointThatFailsIsTriedAgain) {
  Box box;
  const std::string folder = temporary("not_yet_there"), file = folder + "/m.octrad";
  Config config = short_run(30);
  config.checkpoint_seconds = 1e-9;  // after every step
  TrainOptions options;
  options.output = file;
  EXPECT_THROW(train(box.scene, config, options), IoError);
  int failed = 0, saved = 0;
  options.saved = [&](const std::string&, long long) { ++saved; };
  options.not_saved = [&](const std::string& why, long long step) {
    EXPECT_EQ(step, failed + 1);
    EXPECT_NE(why.find(file), std::string::npos) << why;
    if (++failed == 3) std::filesystem::create_directory(folder);
  };
  EXPECT_EQ(train(box.scene, config, options).steps, 30);
  EXPECT_EQ(failed, 3);
  EXPECT_EQ(saved, 27);
  std::filesystem::remove_all(folder);
  options.saved = nullptr;
  options.not_saved = [](const std::string&, long long) {};
  try {
    train(box.scene, config, options);
    ADD_FAILURE() << "the finished model was not saved";
  } catch (const IoError& error) {
    EXPECT_NE(std::string(error.what()).find("nothing of this run is saved"), std::string::npos) << error.what();
  }
}

// A file may be broken, or the scene another one in spite of its fingerprint.
TEST(Train, FarEndsOffTheSceneAreRefusedOnResume) {
  Box box;
  const std::string file = temporary("far_ends.octrad");
  TrainOptions options;
  options.output = file;
  Config config = short_run(3);
  config.adam_decay_start = 1.0;  // far ends fall with the rates
  train(box.scene, config, options);
  for (const auto& [shape, primitive] : {std::pair{1000, 0}, std::pair{0, 1 << 20}, std::pair{0, -1}}) {
    Model model = load_model(file, true);
    ASSERT_EQ(model.info.state.far_end_hits.size(), 32u);
    model.info.config.train_steps = 4;
    model.info.state.far_end_hits[5] = {shape, primitive, 0};
    options.resume = &model;
    EXPECT_THROW(train(box.scene, model.info.config, options), InputError) << shape << ' ' << primitive;
  }
  std::filesystem::remove(file);
}

TEST(Train, TheGuideIsPartOfARunsState) {
  Box box;
  const std::string file = temporary("guide.octrad");
  TrainOptions options;
  options.output = file;
  train(box.scene, short_run(130), options);
  EXPECT_TRUE(load_model(file).info.state.guide_rows.empty());  // only what is trained on needs it
  Model model = load_model(file, true);
  const TrainingState& state = model.info.state;
  EXPECT_GT(std::reduce(state.guide_samples.begin(), state.guide_samples.end()), 0ull);
  EXPECT_GT(state.guide_box[6], 0.0f);
  EXPECT_GT(std::reduce(state.guide_squares.begin(), state.guide_squares.end()), 0ull);
  EXPECT_LT(state.guide_box[0], state.guide_box[3]);

  // A file may be broken, and a run may do without.
  model.info.config.train_steps = 140;
  options.resume = &model;
  model.info.state.guide_columns[5] = 2.0f;
  EXPECT_THROW(train(box.scene, model.info.config, options), InputError);
  model = load_model(file, true);
  model.info.state.guide_samples.clear();
  EXPECT_THROW(train(box.scene, model.info.config, options), InputError);
  model = load_model(file, true);
  model.info.config.train_steps = 140;
  model.info.config.train_guide = 0.0;
  EXPECT_EQ(train(box.scene, model.info.config, options).steps, 140);
  model = load_model(file, true);
  EXPECT_TRUE(model.info.state.guide_rows.empty());
  model.info.config.train_steps = 210;  // and begin to have one
  model.info.config.train_guide = 0.5;
  EXPECT_EQ(train(box.scene, model.info.config, options).steps, 210);
  EXPECT_FALSE(load_model(file, true).info.state.guide_rows.empty());
  std::filesystem::remove(file);
}

// With tables that are used: those of the box seldom are.
TEST(Train, GuidedRunsAreResumedToTheSameBits) {
  Box box;
  const std::string begun = temporary("begun.octrad"), whole = temporary("whole.octrad"),
                    broken = temporary("broken.octrad"), unguided = temporary("unguided.octrad");
  TrainOptions options;
  options.output = begun;
  train(box.scene, short_run(70), options);
  const auto go_on = [&](Model model, const std::string& output, long long stop) {
    model.info.config.train_steps = 210;
    options.output = output;
    options.resume = &model;
    long long step = model.info.state.step;
    options.interrupted = [&] { return step++ >= stop; };
    train(box.scene, model.info.config, options);
    options.interrupted = nullptr;
  };
  const auto drawing_from_everywhere = [&] {
    Model model = load_model(begun, true);
    std::vector<float>&rows = model.info.state.guide_rows, &columns = model.info.state.guide_columns;
    for (std::size_t i = 0; i < rows.size(); ++i) rows[i] = static_cast<float>(i % 8 + 1) / 8.0f;
    for (std::size_t i = 0; i < columns.size(); ++i) columns[i] = static_cast<float>(i % 16 + 1) / 16.0f;
    return model;
  };
  go_on(drawing_from_everywhere(), whole, 210);
  go_on(drawing_from_everywhere(), broken, 100);
  Model half = load_model(broken, true);
  EXPECT_EQ(half.info.state.step, 100);
  EXPECT_EQ(std::ranges::count(half.info.state.guide_rows, 1.0f), 3072) << "tables are no longer used";
  go_on(std::move(half), broken, 210);
  expect_same_tensors(whole, broken);
  go_on(load_model(begun, true), unguided, 210);
  EXPECT_NE(weights_in(unguided, true), weights_in(whole, true)) << "tables drew nothing";
  for (const std::string& file : {begun, whole, broken, unguided}) std::filesystem::remove(file);
}

// Radiance in other units is the same picture: powers of two, so that nothing is rounded differently.
TEST(Train, UnitsOfRadianceDoNotMatter) {
  std::vector<SurfacePoint> probes;
  std::vector<Vec3f> radiance[3];
  const float scales[] = {1.0f, std::ldexp(1.0f, -10), std::ldexp(1.0f, 17)};
  for (int k = 0; k < 3; ++k) {
    Box box(8.0 * static_cast<double>(scales[k]));
    if (probes.empty()) probes = surface_probes(box.scene, 200, 1, short_run(20));
    radiance[k].resize(probes.size());
    train(box.scene, short_run(20), {}).field->radiance(probes, radiance[k]);
    std::size_t lit = 0;
    for (std::size_t i = 0; i < probes.size(); ++i) {
      lit += luminance(radiance[0][i]) > 0.0f;
      for (int c = 0; c < 3; ++c)
        ASSERT_NEAR(radiance[k][i][c] / scales[k], radiance[0][i][c], 1e-5f * radiance[0][i][c]) << scales[k];
    }
    EXPECT_GT(lit, probes.size() / 2);
  }
}

// Rates that rise, averages that begin late, and someone who looks every few steps.
TEST(Train, AveragesDoNotDependOnWhoLooks) {
  Box box;
  const std::string alone = temporary("alone.octrad"), watched = temporary("watched.octrad");
  Config config = short_run(300);
  config.train_average = 0.5;
  config.adam_warmup = 200;
  config.adam_decay_start = 1.0;
  TrainOptions options;
  options.output = alone;
  train(box.scene, config, options);
  options.output = watched;
  Trainer trainer(box.scene, config, options);
  while (!trainer.done()) {
    trainer.step();
    if (trainer.state().step % 7 == 0) trainer.field();
  }
  trainer.finish(false);
  expect_same_tensors(alone, watched);
  const TensorReader file(alone);
  std::vector<float> average(static_cast<std::size_t>(file.get("decoder.mlp.0.weight").count)),
      last(static_cast<std::size_t>(file.get("optimizer.trained.decoder.mlp").count));
  file.read(file.get("decoder.mlp.0.weight"), average.data());
  file.read(file.get("optimizer.trained.decoder.mlp"), last.data());
  EXPECT_FALSE(std::equal(average.begin(), average.end(), last.begin()));

  Model model = load_model(alone);  // as for pictures
  options.resume = &model;
  EXPECT_THROW(train(box.scene, config, options), InputError);
  std::filesystem::remove(alone);
  std::filesystem::remove(watched);
}

TEST(Train, SameBitsAtAnyThreadCount) {
  Box box;
  for (const std::string& field : field_names()) {
    SCOPED_TRACE(field);
    const std::string one = temporary("one.octrad"), three = temporary("three.octrad");
    TrainOptions options;
    for (const auto& [threads, file] : {std::pair{1, one}, std::pair{3, three}}) {
      set_thread_count(threads);
      options.output = file;
      train(box.scene, short_run(8, field), options);
    }
    set_thread_count(0);
    expect_same_tensors(one, three);
    std::filesystem::remove(one);
    std::filesystem::remove(three);
  }
}

TEST(Train, OverBudgetRequestsNameTheKnobs) {
  Box box;
  Config config = short_run(1);
  config.octree_levels = 5;
  TrainOptions options;
  options.max_memory = 1e6;
  try {
    train(box.scene, config, options);
    FAIL() << "a megabyte was enough";
  } catch (const MemoryError& e) {
    for (const char* word : {"octree.levels=4", "octree.features=2", "--max-memory"})
      EXPECT_NE(std::string(e.what()).find(word), std::string::npos) << e.what();
  }
  const std::pair<const char*, const char*> tables[] = {{"nr", "nr.log2_table="}, {"ncr", "ncr.log2_table="}};
  for (const auto& [field, word] : tables) {
    try {
      Config tables_alone = short_run(1, field);
      tables_alone.nr_log2_table = tables_alone.ncr_log2_table = 15;
      train(box.scene, tables_alone, options);
      FAIL() << field;
    } catch (const MemoryError& e) {
      EXPECT_NE(std::string(e.what()).find(word), std::string::npos) << e.what();
    }
  }
  options.max_memory = 1e9;
  options.used_memory = 1e9;
  try {
    train(box.scene, config, options);
    FAIL() << "nothing was left";
  } catch (const MemoryError& e) {
    for (const char* word : {"the budget is 953.7 MiB", "953.7 MiB  the program and the scene"})
      EXPECT_NE(std::string(e.what()).find(word), std::string::npos) << e.what();
  }
}

TEST(Train, OverBudgetIsRefusedOnResumeToo) {
  Box box;
  const std::string file = temporary("budget.octrad");
  TrainOptions options;
  options.output = file;
  train(box.scene, short_run(2), options);
  Model model = load_model(file, true);
  model.info.config.train_steps = 4;
  options.resume = &model;
  options.max_memory = 1e4;
  EXPECT_THROW(train(box.scene, model.info.config, options), MemoryError);
  model = load_model(file, true);
  model.info.config.train_steps = 4;
  options.max_memory = 1e9;
  EXPECT_EQ(train(box.scene, model.info.config, options).steps, 4);
  std::filesystem::remove(file);
}

TEST(Train, NonFiniteValuesStopTheRunWithItsStep) {
  Box box;
  Config config = short_run(2000);
  config.adam_rate_networks = 1e30;  // makes the weights overflow
  config.adam_max_non_finite = 0;
  const std::string file = temporary("bad.octrad");
  TrainOptions options;
  options.output = file;
  try {
    train(box.scene, config, options);
    FAIL() << "nothing overflowed";
  } catch (const InputError& e) {
    EXPECT_EQ(std::string(e.what()).rfind("step ", 0), 0u) << e.what();
  }
  EXPECT_TRUE(std::filesystem::exists(file + ".bad-batch.csv"));
  std::filesystem::remove(file + ".bad-batch.csv");
  std::filesystem::remove(file);
}

TEST(Train, ValidatesAgainstAReferenceAndReportsProgress) {
  Box box;
  Image reference(16, 16, {"R", "G", "B"});
  for (float& v : reference.data) v = 0.5f;
  TrainOptions options;
  options.reference = &reference;
  int reports = 0;
  options.progress = [&](const TrainProgress& p) {
    ++reports;
    EXPECT_EQ(p.steps, 5);
    EXPECT_GT(p.points_per_second, 0.0);
    EXPECT_GT(p.loss, 0.0);
  };
  const TrainResult result = train(box.scene, short_run(5), options);
  EXPECT_GE(reports, 1);
  EXPECT_GT(result.validation_mape, 0.0);
  EXPECT_EQ(result.lhs_samples, 5 * 64);
  // Beside an enormous reference every picture is black: |0 - r| / (r + 0.01).
  for (float& v : reference.data) v = 1e6f;
  EXPECT_NEAR(train(box.scene, short_run(5), options).validation_mape, 1.0, 1e-4);
  Image large(160, 120, {"R", "G", "B"});
  for (std::size_t k = 0; k < large.data.size(); ++k) large.data[k] = static_cast<float>(k % 7);
  options.reference = &large;
  set_thread_count(1);
  const double one = train(box.scene, short_run(5), options).validation_mape;
  set_thread_count(3);
  EXPECT_EQ(train(box.scene, short_run(5), options).validation_mape, one);
  set_thread_count(0);
  EXPECT_GT(one, 0.1);
}

TEST(Train, ValidationIsNotTrainingTime) {
  Box box;
  Image reference(16, 16, {"R", "G", "B"});
  TrainOptions options;
  options.reference = &reference;
  options.validation_seconds = 1e-9;
  int validated = 0;
  options.validated = [&](long long, double, double) {
    ++validated;
    std::this_thread::sleep_for(std::chrono::milliseconds(40));
  };
  const auto start = std::chrono::steady_clock::now();
  const TrainResult result = train(box.scene, short_run(5), options);
  const double all = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  EXPECT_EQ(validated, 5);
  EXPECT_LT(result.seconds, all - 4 * 0.04);  // the last step ends before its validation
}

TEST(Train, AllFieldsAndPresetsTakeAStep) {
  Box box;
  for (const char* name : {"paper", "default", "cpu"}) {
    for (const std::string& field : field_names()) {
      Config config = preset(name);
      config.field = field;
      config.octree_levels = 3;  // the full size is a matter of memory only
      config.disparity_log2_table = 10;
      config.nr_log2_table = 10;
      config.ncr_log2_table = 10;
      config.ncr_cone_log2_table = 10;
      config.train_steps = 4;
      config.train_points = 128;
      config.train_directions = 4;
      if (config.octree_occupancy == OctreeOccupancy::sampled)
        config.octree_occupancy = OctreeOccupancy::conservative;  // 2^26 samples take seconds
      const TrainResult result = train(box.scene, config, {});
      EXPECT_EQ(result.steps, 4);
      EXPECT_TRUE(std::isfinite(result.loss)) << name << " " << field;
    }
  }
}

}  // namespace
}  // namespace octrad
