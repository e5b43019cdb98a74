// Optimisers on the device take the steps of those on the CPU.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <vector>

#include "octrad/base/random_inputs.h"
#include "octrad/device/stream_test_helper.h"
#include "octrad/network/adam_device.h"
#include "octrad/network/checks.h"

namespace octrad {
namespace {

constexpr int kFeatures = 4;
constexpr std::size_t kEntries = 3000;

// Every third entry of a table receives something, in every step something else.
struct TouchThirds : Kernel {
  AddNow sink;
  float value;
  OCTRAD_HD void operator()(std::uint32_t i) const {
    const float x[kFeatures] = {value, -value * static_cast<float>(i), 0.5f, 1.0f};
    sink.add<kFeatures>(0, 3 * i, 0.25f, x);
  }
};

// Two networks, and a table of each kind.
struct Optimized {
  static constexpr std::array<std::size_t, 2> kSizes{5000, 77};
  std::vector<DeviceArray<float>> parameters, gradients;
  std::vector<DeviceDenseAdam> networks;
  std::vector<DeviceTable> tables;
  DeviceArray<unsigned long long> counters;  // dropped, touched

  explicit Optimized(Stream& stream) : counters(stream, 2, "test") {
    for (const std::size_t n : kSizes) {
      std::vector<float> gradient = testing::random_floats(n, n + 1);
      gradient[13] = HUGE_VALF;
      parameters.emplace_back(stream, std::span<const float>(testing::random_floats(n, n)), "test");
      gradients.emplace_back(stream, std::span<const float>(gradient), "test");
      networks.emplace_back(stream, n, AdamOptions{.beta1 = n == 77 ? 0.8 : 0.9}, "test");
    }
    for (int kind = 0; kind < 4; ++kind) {
      DeviceTableOptions options;
      options.training = true;
      options.scan_touched = kind == 1;
      options.dense = kind >= 2;
      options.half_moments = kind == 3;
      options.touches = kEntries;
      tables.emplace_back(stream, kEntries, kFeatures, options, "test");
      tables.back().upload(stream, testing::random_floats(kEntries * kFeatures, 5), nullptr);
    }
    counters.fill(0);
  }
  void add_network(DeviceOptimizers& to, std::size_t i) {
    to.add(networks[i], parameters[i].data(), gradients[i].data(), 1e-2 / static_cast<double>(i + 1));
  }
  void add_table(DeviceOptimizers& to, std::size_t i) { to.add(tables[i], 1e-2 * static_cast<double>(i + 1)); }
  std::vector<std::vector<float>> learnt() const {
    std::vector<std::vector<float>> all;
    for (const auto& p : parameters) all.push_back(p.download());
    for (const DeviceTable& table : tables) {
      std::vector<float> values(kEntries * kFeatures);
      SparseAdam state(kEntries, kFeatures, {});
      table.download(values, &state);
      all.push_back(values);
      all.emplace_back(state.moments().begin(), state.moments().end());
    }
    return all;
  }
};

class DeviceAdam : public testing::StreamTest {};

TEST_P(DeviceAdam, StepsAreThoseOfTheCpu) {
  EXPECT_TRUE(testing::passed(check_adam_update(*stream, 5000, 1)));
  EXPECT_TRUE(testing::passed(check_dense_adam(*stream, 5000, 2)));
  for (const TableMode mode : {TableMode::touched, TableMode::dense, TableMode::dense_half_moments})
    EXPECT_TRUE(testing::passed(check_table_adam(*stream, 300, mode, 3))) << static_cast<int>(mode);
}

TEST_P(DeviceAdam, OptimizersStepTogetherAsEachAlone) {
  Optimized together(*stream), alone(*stream);
  DeviceOptimizers all;
  std::vector<DeviceOptimizers> each;
  for (std::size_t i = 0; i < together.networks.size(); ++i) {
    together.add_network(all, i);
    alone.add_network(each.emplace_back(), i);
  }
  for (std::size_t i = 0; i < together.tables.size(); ++i) {
    together.add_table(all, i);
    alone.add_table(each.emplace_back(), i);
  }
  const auto step = [&](Optimized& model, const DeviceOptimizers& optimizers, const float* rate_scale) {
    optimizers.advance(*stream, rate_scale, rate_scale, model.counters.data() + 1);
    optimizers.step_networks(*stream, model.counters.data());
    optimizers.step_tables(*stream, model.counters.data());
  };
  constexpr unsigned long long kTouched = kEntries / 3, kSteps = 3;
  for (unsigned long long s = 1; s <= kSteps; ++s) {
    const float scale = 1.0f / static_cast<float>(s);
    const DeviceArray<float> rate_scale(*stream, std::span(&scale, 1), "test");
    for (Optimized* model : {&together, &alone}) {
      for (const DeviceTable& table : model->tables)
        launch(*stream, kTouched, TouchThirds{{}, table.add(), static_cast<float>(s)});
    }
    step(together, all, rate_scale.data());
    for (const DeviceOptimizers& one : each) step(alone, one, rate_scale.data());
    stream->synchronize();
  }
  EXPECT_EQ(together.learnt(), alone.learnt());
  const std::vector<unsigned long long> counted{2 * kSteps, (2 * kTouched + 2 * kEntries) * kSteps};
  EXPECT_EQ(together.counters.download(), counted);
  EXPECT_EQ(alone.counters.download(), counted);
  // One to advance, one for the networks, and of the tables 1, 2, 2 and 2.
  const DeviceArray<float> rate_scale(*stream, 1, "test");
  EXPECT_EQ(stream->capture([&] { step(together, all, rate_scale.data()); })->size(), 9u);
}

TEST_P(DeviceAdam, MemoryIsWhatWasEstimated) {
  for (const bool training : {false, true}) {
    for (const bool sorted : {false, true}) {
      const auto total = [](const std::vector<MemoryPart>& parts) {
        double sum = 0.0;
        for (const MemoryPart& p : parts) sum += static_cast<double>(p.bytes);
        return sum;
      };
      DeviceTableOptions options;
      options.training = training;
      options.sorted = options.dense = options.half_moments = sorted && training;
      options.slots = options.touches = 50'000;
      const std::size_t before = stream->allocated_bytes();
      const DeviceTable table(*stream, 100'000, 4, options, "test");
      const double took = static_cast<double>(stream->allocated_bytes() - before);
      EXPECT_NEAR(total(DeviceTable::memory(100'000, 4, options, "test")), took, 0.05 * took + 5e5);
    }
  }
}

INSTANTIATE_TEST_SUITE_P(All, DeviceAdam, ::testing::Bool(), testing::stream_name);

}  // namespace
}  // namespace octrad
