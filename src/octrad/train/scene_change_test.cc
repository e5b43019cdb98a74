// Trainer: steps one by one, and scenes that change while they are learnt.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "octrad/base/error.h"
#include "octrad/base/folder_test_helper.h"
#include "octrad/base/sanitized_test_helper.h"
#include "octrad/base/threads.h"
#include "octrad/device/stream_test_helper.h"
#include "octrad/scene/sample_scenes.h"
#include "octrad/train/batch.h"
#include "octrad/train/box_test_helper.h"
#include "octrad/train/changed_points.h"
#include "octrad/train/checks.h"
#include "octrad/train/narrow_networks_test_helper.h"
#include "octrad/train/schedule.h"
#include "octrad/train/trainer.h"

namespace octrad {
namespace {

using testing::Box;

// With the preset's networks: narrow ones do not learn a change in so few steps.
Config learning_run(int steps) {
  Config config = preset("cpu");
  config.train_steps = steps;
  config.train_points = 256;
  config.train_directions = 4;
  config.octree_levels = 3;
  config.disparity_log2_table = 10;
  config.train_poses = 8;
  return config;
}

Config small_run(int steps) {
  Config config = learning_run(steps);
  testing::narrow_networks(config);
  return config;
}

std::vector<Vec3f> ask(Trainer& trainer, const std::vector<SurfacePoint>& points) {
  std::vector<Vec3f> radiance(points.size());
  trainer.field().radiance(points, radiance);
  return radiance;
}

// Also where somebody looks at the field all the time.
TEST(Trainer, StepsAreThoseOfTrain) {
  Box box;
  const Config config = small_run(12);
  const std::vector<SurfacePoint> probes = surface_probes(box.scene, 100, 1, config);
  std::vector<Vec3f> expected(probes.size());
  const TrainResult whole = train(box.scene, config, {});
  whole.field->radiance(probes, expected);
  Trainer trainer(box.scene, config, {});
  RadianceField* const field = &trainer.field();
  int steps = 0;
  for (; !trainer.done(); ++steps) {
    trainer.step();
    trainer.untimed([&] { ask(trainer, probes); });
    EXPECT_EQ(trainer.last_points().size(), 256u);
    EXPECT_EQ(field, &trainer.field());
  }
  EXPECT_EQ(steps, 12);
  EXPECT_EQ(trainer.state().step, 12);
  EXPECT_EQ(ask(trainer, probes), expected);
  const TrainResult result = trainer.finish(false);
  EXPECT_EQ(result.loss, whole.loss);
  EXPECT_EQ(result.rhs_queries, whole.rhs_queries);
  EXPECT_EQ(result.field.get(), field);
}

// Radiance is linear in emission: nothing has to be learnt.
TEST(Trainer, AllOfTheEmissionTimesAFactorIsRadianceTimesIt) {
  Box box;
  Trainer trainer(box.scene, small_run(20), {});
  while (!trainer.done()) trainer.step();
  const std::vector<SurfacePoint> probes = surface_probes(box.scene, 200, 1, trainer.config());
  const std::vector<Vec3f> before = ask(trainer, probes);
  trainer.scene_changed(box.scene.set_light_factor(0, Vec3f(4.0f)));
  EXPECT_TRUE(trainer.done());
  std::vector<Vec3f> after = ask(trainer, probes);
  for (std::size_t i = 0; i < probes.size(); ++i) EXPECT_EQ(after[i], before[i] * 4.0f);
  // Off: no light at all, and nothing is learnt from that.
  trainer.scene_changed(box.scene.set_light_factor(0, Vec3f(0.0f)));
  const long long step = trainer.state().step;
  trainer.step();
  EXPECT_EQ(trainer.state().step, step);
  after = ask(trainer, probes);
  for (std::size_t i = 0; i < probes.size(); ++i) EXPECT_LE(luminance(after[i]), 1e-15f);
  trainer.scene_changed(box.scene.set_light_factor(0, Vec3f(1.0f)));
  after = ask(trainer, probes);
  for (std::size_t i = 0; i < probes.size(); ++i) {
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(after[i][c], before[i][c], 1e-5f * before[i][c]);
  }
  EXPECT_TRUE(trainer.done());
}

void set_all_lights(PreparedScene& scene, Trainer& trainer, Vec3f factor) {
  SceneChange change;
  for (int i = 0; i < scene.light_count(); ++i) change += scene.set_light_factor(i, factor);
  trainer.scene_changed(change);
}

// Means of weights that were right for another scene would be in the way.
TEST(Trainer, AveragesBeginAnewWhereAChangeIsLearnt) {
  PreparedScene scene(testing::closed_room());
  Config config = small_run(200);
  config.train_average = 0.5;
  config.adam_decay_start = 1.0;
  TestFolder folder;
  TrainOptions options;
  options.output = folder.file("change.octrad");
  Trainer trainer(scene, config, options);
  while (!trainer.done()) trainer.step();
  const std::vector<SurfacePoint> probes = surface_probes(scene, 200, 1, config);
  const auto of = [&](const RadianceField& field) {
    std::vector<Vec3f> radiance(probes.size());
    field.radiance(probes, radiance);
    return radiance;
  };
  const auto saved_are_weights = [&] {
    trainer.checkpoint(true);
    const Model model = load_model(options.output, true);
    return of(*model.field) == of(*model.trained);
  };
  EXPECT_FALSE(saved_are_weights());
  const std::vector<Vec3f> before = ask(trainer, probes);
  trainer.scene_changed(scene.set_light_factor(0, {1.0f, 0.5f, 0.25f}));
  EXPECT_GT(trainer.change_steps_left(), 0);
  // Nothing is learnt yet, and the exposure is the same.
  EXPECT_EQ(ask(trainer, probes), before);
  trainer.step();
  EXPECT_TRUE(saved_are_weights());
  for (int i = 1; i < 128; ++i) trainer.step();
  EXPECT_TRUE(saved_are_weights());
  for (int i = 0; i < 32; ++i) trainer.step();
  EXPECT_FALSE(saved_are_weights());
}

TEST(Trainer, LampsComeBackFromTheDarkInAnotherColour) {
  TestFolder folder;
  PreparedScene scene(testing::closed_room());
  TrainOptions options;
  options.output = folder.file("dark.octrad");
  Trainer trainer(scene, small_run(2), options);
  while (!trainer.done()) trainer.step();
  const float scale = trainer.field().target_scale();
  set_all_lights(scene, trainer, Vec3f(0.0f));
  EXPECT_TRUE(trainer.is_dark());
  EXPECT_LT(trainer.field().target_scale(), 1e-10f * scale);
  trainer.checkpoint(true);  // of the light that was on last, so that it can be trained on
  EXPECT_LT(trainer.field().target_scale(), 1e-10f * scale);
  EXPECT_EQ(load_model(options.output).field->target_scale(), scale);
  std::filesystem::remove(options.output);
  std::filesystem::create_directory(options.output);  // where nothing can be written
  EXPECT_THROW(trainer.checkpoint(true), IoError);
  EXPECT_LT(trainer.field().target_scale(), 1e-10f * scale);
  std::filesystem::remove(options.output);
  trainer.scene_changed(scene.set_light_factor(0, {1.0f, 0.5f, 0.25f}));
  EXPECT_FALSE(trainer.is_dark());
  EXPECT_EQ(trainer.field().target_scale(), scale);
  EXPECT_EQ(trainer.change_steps_left(), Trainer::kChangeSteps);
}

TEST(Trainer, WhatIsPaintedInTheDarkIsLearntInTheLight) {
  PreparedScene scene(testing::closed_room());
  Trainer trainer(scene, small_run(2), {});
  while (!trainer.done()) trainer.step();
  set_all_lights(scene, trainer, Vec3f(0.0f));
  trainer.scene_changed(scene.set_material_edit(scene.scene().shapes[4].material, {Vec3f(0.1f, 0.9f, 0.1f), {}}));
  EXPECT_EQ(trainer.change_steps_left(), 0);
  set_all_lights(scene, trainer, Vec3f(1.0f));
  EXPECT_EQ(trainer.change_steps_left(), Trainer::kChangeSteps);
}

// Mean relative difference from what the right-hand side gives at points that walks reach: not on the outer sides of a
// closed room, on which no point falls in the end.
double residual(Trainer& trainer, const PreparedScene& scene) {
  BatchSource batch(scene, trainer.config(), {});
  ScheduleState s = schedule(trainer.config(), 0, 0.0);
  s.points = 1000;
  s.by_area = 0.0;
  s.directions = testing::sanitized() ? 4 : 64;
  const RadianceField& field = trainer.field();  // brought up to date here, and not by the threads that ask it
  batch.draw(1ull << 40, s, [&](std::span<const SurfacePoint> p, std::span<Vec3f> out) { field.radiance(p, out); });
  const std::vector<Vec3f> predicted = ask(trainer, batch.points());
  double sum = 0.0;
  for (std::size_t i = 0; i < predicted.size(); ++i)
    sum += std::fabs(luminance(predicted[i]) - luminance(batch.targets()[i])) / (luminance(batch.targets()[i]) + 0.01);
  return sum / static_cast<double>(predicted.size());
}

// A lamp of two in another colour, and a wall that is painted: learnt in the steps that were promised, the same bits at
// any thread count.
TEST(Trainer, ChangesAreLearnt) {
  const int steps = testing::sanitized() ? 10 : 150;  // too few to learn anything
  std::vector<Vec3f> radiance[2];
  for (const int threads : {1, 3}) {
    set_thread_count(threads);
    PreparedScene scene(testing::closed_room());
    const Config config = learning_run(steps);
    Trainer trainer(scene, config, {});
    while (!trainer.done()) trainer.step();
    const double learnt = residual(trainer, scene);
    SceneChange change = scene.set_light_factor(0, {8.0f, 1.0f, 0.125f});
    change += scene.set_material_edit(scene.scene().shapes[4].material, {Vec3f(0.1f, 0.9f, 0.1f), {}});
    trainer.scene_changed(change);
    EXPECT_EQ(trainer.change_steps_left(), Trainer::kChangeSteps);
    EXPECT_FALSE(trainer.done());
    const double surprised = residual(trainer, scene);
    for (int i = 0; i < steps; ++i) trainer.step();
    EXPECT_EQ(trainer.change_steps_left(), Trainer::kChangeSteps - steps);
    EXPECT_NEAR(trainer.progress().rate_scale, 50.0 / (50.0 + steps - 1.0), 1e-6);
    const double relearnt = residual(trainer, scene);
    if (!testing::sanitized()) {
      EXPECT_GT(surprised, 1.5 * learnt);
      EXPECT_LT(relearnt, 0.7 * surprised) << learnt;
    }
    radiance[threads / 2] = ask(trainer, surface_probes(scene, 200, 1, config));
  }
  set_thread_count(0);
  EXPECT_EQ(radiance[0], radiance[1]);
}

class TrainerOnDevices : public testing::StreamTest {};

TEST_P(TrainerOnDevices, ChangesAreLearnt) {
  PreparedScene scene(testing::closed_room());
  TrainOptions options;
  options.stream = stream.get();
  const int steps = testing::sanitized() ? 8 : 100;
  Trainer trainer(scene, learning_run(std::min(steps, 64)), options);
  while (!trainer.done()) trainer.step();
  const std::vector<SurfacePoint> probes = surface_probes(scene, 200, 1, trainer.config());
  const std::vector<Vec3f> before = ask(trainer, probes);
  trainer.scene_changed(scene.set_light_factor(0, Vec3f(2.0f)));
  const std::vector<Vec3f> twice = ask(trainer, probes);
  for (std::size_t i = 0; i < probes.size(); ++i) ASSERT_EQ(twice[i], before[i] * 2.0f);
  trainer.scene_changed(scene.set_light_factor(0, {8.0f, 2.0f, 0.5f}));
  const double surprised = residual(trainer, scene);
  for (int i = 0; i < steps; ++i) trainer.step();
  trainer.untimed([] {});
  const double relearnt = residual(trainer, scene);
  if (!testing::sanitized()) {
    EXPECT_LT(relearnt, 0.7 * surprised);
  }
}

INSTANTIATE_TEST_SUITE_P(All, TrainerOnDevices, ::testing::Bool(), testing::stream_name);

TEST(ChangedPoints, LieOnWhatChangedAndOnWhatItLights) {
  PreparedScene scene(testing::closed_room());
  const Config config = small_run(1);
  SceneChange change = scene.set_light_factor(0, Vec3f(2.0f));
  ASSERT_EQ(change.shapes.size(), 1u);
  const ChangedPoints changed(scene, lhs_options(config), change);
  ASSERT_FALSE(changed.empty());
  std::vector<ShadingPoint> points(4000);
  for (ShadingPoint& p : points) p.surface.shape = -1;
  changed.replace(3, points);
  int on = 0, lit = 0;
  for (const ShadingPoint& p : points) {
    if (p.surface.shape < 0) continue;  // a ray that left the lamp's back
    ASSERT_GT(dot(p.wo, viewed_normal(p)), 0.0f);
    ASSERT_FALSE(p.black);
    on += p.surface.shape == change.shapes[0];
    lit += p.surface.shape != change.shapes[0];
  }
  EXPECT_GT(on, 500);
  EXPECT_GT(lit, 500);
  // The same points again, and others in another step.
  std::vector<ShadingPoint> again(4000), other(4000);
  changed.replace(3, again);
  changed.replace(4, other);
  int same = 0, differ = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    same += points[i].surface.shape < 0 || points[i].surface.position == again[i].surface.position;
    differ += !(other[i].surface.position == again[i].surface.position);
  }
  EXPECT_EQ(same, 4000);
  EXPECT_GT(differ, 1000);
  // Of a bulb: what it lights. Of the sky: nothing in particular.
  SceneChange bulb;
  bulb.lights.push_back({0.2f, 0.3f, -0.1f});
  ChangedPoints(scene, lhs_options(config), bulb).replace(1, points);
  EXPECT_GT(std::count_if(points.begin(), points.end(), [](const ShadingPoint& p) { return p.surface.shape >= 0; }),
            3900);
  EXPECT_TRUE(ChangedPoints(scene, lhs_options(config), {}).empty());
}

}  // namespace
}  // namespace octrad
