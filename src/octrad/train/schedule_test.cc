#include "octrad/train/schedule.h"

#include <gtest/gtest.h>

#include <cmath>

namespace octrad {
namespace {

TEST(Schedule, QuartersHalveTheBatchAndTheEpsilon) {
  Config config = preset("paper");
  const ScheduleState first = schedule(config, 0, 0.0), last = schedule(config, 19999, 0.99);
  EXPECT_EQ(first.points, 65536);
  EXPECT_EQ(first.directions, 32);
  EXPECT_DOUBLE_EQ(first.epsilon, 0.1);
  EXPECT_DOUBLE_EQ(first.rate_scale, 1.0);
  EXPECT_EQ(last.points, 8192);
  EXPECT_EQ(last.directions, 256);
  EXPECT_NEAR(last.epsilon, 0.0125, 1e-12);
  EXPECT_DOUBLE_EQ(last.rate_scale, 1.0);
  config = preset("cpu");
  EXPECT_LT(schedule(config, 0, 0.0).rate_scale, 0.02);
  EXPECT_NEAR(schedule(config, 100000, 1.0).rate_scale, 0.02, 1e-9);
  // The networks' rate is lower in long runs: a half where the budget has three times adam.rate.budget steps.
  EXPECT_EQ(config.adam_rate_budget, 5000);
  EXPECT_EQ(schedule(config, 0, 0.0).network_scale, schedule(config, 0, 0.0).rate_scale);
  EXPECT_DOUBLE_EQ(schedule(config, 3000, 0.2).network_scale, 0.5);
  EXPECT_DOUBLE_EQ(schedule(config, 300, 0.2).network_scale, 1.0 / std::sqrt(1.3));
  EXPECT_NEAR(schedule(config, 15000, 1.0).network_scale, 0.01, 1e-9);
  config.train_steps = 15000;
  EXPECT_DOUBLE_EQ(schedule(config, 200, 0.0).network_scale, 0.5);
  config.field = "nr";
  EXPECT_DOUBLE_EQ(schedule(config, 3000, 0.2).network_scale, 1.0);
  config = preset("default");
  EXPECT_DOUBLE_EQ(schedule(config, 3000, 0.2).network_scale, 1.0);
}

TEST(Schedule, BatchesGrowFromTheFirstPoints) {
  Config config = preset("default");
  for (int quarter = 0; quarter < 4; ++quarter) {
    for (const double fraction : {quarter / 4.0, (quarter + 0.99) / 4.0}) {
      const ScheduleState s = schedule(config, 1000, fraction);
      EXPECT_EQ(s.points, 8192 << quarter) << fraction;
      EXPECT_EQ(s.directions, 32);
    }
  }
  EXPECT_EQ(schedule(config, 1000, 1.0).points, 65536);
  config.train_points = 20000;  // never more
  EXPECT_EQ(schedule(config, 1000, 0.3).points, 16384);
  EXPECT_EQ(schedule(config, 1000, 0.6).points, 20000);
  config.train_first_points = 1;  // a step has 64 points
  EXPECT_EQ(schedule(config, 0, 0.0).points, 64);
  EXPECT_EQ(schedule(config, 0, 1.0).points, 512);
  config.train_first_points = 1 << 20;
  EXPECT_EQ(schedule(config, 0, 1.0).points, 20000);
  // Of the paper's quarters it is a limit.
  config = preset("paper");
  config.train_first_points = 16384;
  const int points[] = {16384, 32768, 16384, 8192};
  for (int quarter = 0; quarter < 4; ++quarter) {
    EXPECT_EQ(schedule(config, 0, quarter / 4.0).points, points[quarter]);
    EXPECT_EQ(schedule(config, 0, quarter / 4.0).directions, 32 << quarter);
  }
}

// They fall as the cube of the rates, in eighths, but do not wait for the warm-up.
TEST(Schedule, FarEndsAndPointsByArea) {
  Config config = preset("cpu");
  EXPECT_EQ(config.train_far_ends, 0.3);
  EXPECT_EQ(schedule(config, 0, 0.0).far_ends, 153);      // of 512
  EXPECT_EQ(schedule(config, 9000, 0.3).far_ends, 153);   // rates fall from here
  EXPECT_EQ(schedule(config, 19500, 0.65).far_ends, 19);  // of a half and 1 %
  EXPECT_EQ(schedule(config, 20400, 0.68).far_ends, 0);
  // Points by area too.
  EXPECT_EQ(schedule(config, 9000, 0.3).by_area, 1.0);
  EXPECT_EQ(schedule(config, 19500, 0.65).by_area, 0.125);
  EXPECT_EQ(schedule(config, 20400, 0.68).by_area, 0.0);
  for (const auto& [key, value] :
       {std::pair{"train.area_falls", "false"}, {"train.sampler", "area"}, {"train.sampler", "walks"}}) {
    Config other = config;
    set(other, key, value);
    EXPECT_EQ(schedule(other, 30000, 1.0).by_area, 1.0) << key << " " << value;
  }
  EXPECT_EQ(schedule(preset("default"), 30000, 1.0).by_area, 1.0);
  Config counted = config;  // changes where a device may begin to draw
  counted.train_steps = 100;
  double before = 1.0;
  for (int step = 0; step < 110; ++step) {
    const double now = schedule(counted, step, 0.0).by_area;
    EXPECT_LE(now, before);
    if (step % 16 != 0) {
      EXPECT_EQ(now, before) << step;
    }
    before = now;
  }
  EXPECT_EQ(before, 0.0);
  EXPECT_EQ(schedule(config, 30000, 1.0).far_ends, 0);
  config.adam_decay_start = 1.0;
  EXPECT_EQ(schedule(config, 30000, 1.0).far_ends, 153);
  EXPECT_EQ(schedule(preset("default"), 0, 0.0).far_ends, 0);
  EXPECT_EQ(schedule(preset("paper"), 0, 0.0).far_ends, 0);
}

TEST(Schedule, TheLossIsAMeanOverTheLastTenthOfTheSteps) {
  EXPECT_EQ(smoothed_loss(-1.0, 3.0, 0), 3.0);
  double smoothed = -1.0;
  for (int i = 0; i < 50; ++i) smoothed = smoothed_loss(smoothed, i, i);
  EXPECT_NEAR(smoothed, 24.5, 1e-9);  // of the first 50 steps, all
  // A loss that falls from 1 to 0 at some step has left the mean to 1 / e a tenth later.
  for (const long long step : {1000LL, 4000LL, 100000LL}) {
    double after = 1.0;
    const long long window = std::min(500LL, step / 10);
    for (long long i = 0; i < window; ++i) after = smoothed_loss(after, 0.0, step + i);
    EXPECT_NEAR(after, std::exp(-1.0), 0.03) << step;
  }
}

TEST(Schedule, AveragesAreOfTheLastTenthOfTheSteps) {
  Config config = preset("cpu");
  ASSERT_EQ(config.train_average, 0.1);
  for (const long long step : {0LL, 1LL, 100LL, 640LL}) EXPECT_EQ(average_share(config, step, 1.0), 1.0) << step;
  int passes = 0;  // over all weights
  for (long long step = 641; step <= 100000; ++step) {
    const double share = average_share(config, step, 1.0);
    ASSERT_GE(share, 0.0);
    ASSERT_LT(share, 1.0);
    passes += share > 0.0 && step > 50000;
  }
  EXPECT_EQ(passes, 781);
  // What the average holds of the weights before some step has fallen to 1 / e a tenth later, and it tells how old the
  // weights are that it holds.
  for (const long long step : {5000LL, 20000LL, 100000LL}) {
    double held = 1.0, age = 0.0;
    for (long long i = step; i < step + step / 10; ++i) held *= 1.0 - average_share(config, i, 1.0);
    EXPECT_NEAR(held, std::exp(-1.0), 0.1) << step;
    for (long long i = 641; i <= step; ++i) {
      const double share = average_share(config, i, 1.0);
      age = (age + 1.0) * (1.0 - share);
    }
    EXPECT_NEAR(age / static_cast<double>(step), 0.08, 0.03) << step;
  }
  // At a hundredth of the rates they are of a tenth of the steps.
  double held = 1.0;
  for (long long i = 50000; i < 50500; ++i) held *= 1.0 - average_share(config, i, 0.01);
  EXPECT_NEAR(held, std::exp(-1.0), 0.1);
  EXPECT_EQ(average_share(config, 6400, 0.01), 1.0);
  EXPECT_LT(average_share(config, 6401, 0.01), 1.0);
  config.train_average = 0.0;
  for (const long long step : {0LL, 64LL, 100000LL}) EXPECT_EQ(average_share(config, step, 1.0), 1.0) << step;
}

TEST(Schedule, SpentBudget) {
  Config config = preset("cpu");
  TrainingState state;
  state.step = 30;
  state.seconds = 60.0;
  config.train_seconds = 240.0;
  EXPECT_DOUBLE_EQ(spent_budget(config, state), 0.25);
  config.train_steps = 60;
  EXPECT_DOUBLE_EQ(spent_budget(config, state), 0.5);
  config.train_steps = 20;
  EXPECT_EQ(spent_budget(config, state), 1.0);
}

}  // namespace
}  // namespace octrad
