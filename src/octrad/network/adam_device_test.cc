// Optimisers on the device take the steps of those on the CPU.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

#include "octrad/base/rng.h"
#include "octrad/device/stream_test_helper.h"
#include "octrad/network/adam_device.h"

namespace octrad {
namespace {

std::vector<float> random_values(std::size_t n, std::uint64_t stream) {
  Rng rng(9, RngPurpose::test, stream);
  std::vector<float> values(n);
  for (float& v : values) v = 2.0f * rng.uniform() - 1.0f;
  return values;
}

template <int C, typename Sink>
struct Contribute : Kernel {
  const SparseTap* taps;
  const float* upstream;
  Sink sink;
  OCTRAD_HD void operator()(std::uint32_t i) const {
    sink.template add<C>(i, taps[i].entry, taps[i].scale, upstream + taps[i].source * C);
  }
};

class DeviceAdam : public ::testing::TestWithParam<bool> {
 protected:
  void SetUp() override {
    stream_ = testing::stream_or_skip(GetParam());
    if (!stream_) GTEST_SKIP() << testing::kNoDevice;
  }
  // Equal bits on the host; a device contracts multiplications.
  void expect_same(const std::vector<float>& got, std::span<const float> expected, bool same_order) {
    ASSERT_EQ(got.size(), expected.size());
    for (std::size_t i = 0; i < got.size(); ++i) {
      if (same_order && !stream_->on_device()) {
        ASSERT_EQ(got[i], expected[i]) << i;
      } else {
        ASSERT_NEAR(got[i], expected[i], 2e-5 * (1.0 + std::abs(expected[i]))) << i;
      }
    }
  }
  std::unique_ptr<Stream> stream_;
  const AdamOptions options_{0.9, 0.99, 1e-8};
};

TEST_P(DeviceAdam, DenseStepsAndTheirStateMove) {
  const std::size_t n = 5000;
  DenseAdam cpu(n, options_);
  std::vector<float> parameters = random_values(n, 1);
  for (std::uint64_t s = 0; s < 3; ++s) cpu.step(parameters, random_values(n, 10 + s), 1e-2 * 0.5);
  DeviceDenseAdam device(*stream_, n, options_, "test");
  device.upload(cpu);
  const std::vector<float> half{0.5f};
  DeviceArray<float> p(*stream_, std::span<const float>(parameters), "p"),
      scale(*stream_, std::span<const float>(half), "scale");
  DeviceArray<unsigned long long> dropped(*stream_, 1, "dropped");
  dropped.fill(0);
  std::int64_t expected_dropped = 0;
  for (std::uint64_t s = 3; s < 6; ++s) {
    std::vector<float> gradient = random_values(n, 10 + s);
    gradient[17] = std::numeric_limits<float>::quiet_NaN();
    gradient[18] = 1e30f;
    expected_dropped += cpu.step(parameters, gradient, 1e-2 * 0.5);
    const DeviceArray<float> g(*stream_, std::span<const float>(gradient), "g");
    device.step(*stream_, p.data(), g.data(), 1e-2, scale.data(), dropped.data());
  }
  expect_same(p.download(), parameters, true);
  EXPECT_EQ(dropped.download()[0], static_cast<unsigned long long>(expected_dropped));
  DenseAdam back(n, options_);
  device.download(back);
  EXPECT_EQ(back.count(), 6);
  expect_same({back.m().begin(), back.m().end()}, cpu.m(), true);
  expect_same({back.v().begin(), back.v().end()}, cpu.v(), true);
}

TEST_P(DeviceAdam, TableStepsAreThoseOfTheCpu) {
  constexpr int C = 4;
  const std::size_t entries = 1000, sources = 300, taps = 2400;
  for (const bool sorted : {false, true}) {
    for (const bool dense : {false, true}) {
      SCOPED_TRACE(std::string(sorted ? "sorted" : "as they come") + (dense ? ", dense" : ", touched"));
      SparseAdam cpu(entries, C, options_);
      cpu.set_dense(dense);
      std::vector<float> table = random_values(entries * C, 1);
      DeviceTableOptions options;
      options.training = true;
      options.dense = dense;
      options.sorted = sorted;
      options.slots = options.touches = taps;
      options.adam = options_;
      DeviceTable device(*stream_, entries, C, options, "test");
      device.upload(*stream_, table, &cpu);
      const std::vector<float> one{1.0f};
      const DeviceArray<float> scale(*stream_, std::span<const float>(one), "scale");
      DeviceArray<unsigned long long> counters(*stream_, 2, "counters");
      counters.fill(0);
      SparseAdam::Result expected;
      for (std::uint64_t s = 0; s < 4; ++s) {
        std::vector<SparseTap> list;
        Rng rng(2, RngPurpose::test, s);
        // Slot i belongs to item i / 8 here: source i / 8, in a batch of one level.
        for (std::uint32_t i = 0; i < taps; ++i) list.push_back({rng.below(entries / 3) * 3, i / 8, rng.uniform()});
        std::vector<float> upstream = random_values(sources * C, 20 + s), by_number(sources * C);
        upstream[7] = std::numeric_limits<float>::infinity();
        for (std::size_t i = 0; i < sources; ++i) {
          for (std::size_t c = 0; c < C; ++c) by_number[c * sources + i] = upstream[i * C + c];
        }
        const std::vector<std::span<const SparseTap>> blocks{list};
        const SparseAdam::Result result = cpu.step(table, blocks, upstream, 1e-2);
        expected.touched += result.touched;
        expected.non_finite += result.non_finite;
        const DeviceArray<SparseTap> t(*stream_, std::span<const SparseTap>(list), "taps");
        const DeviceArray<float> u(*stream_, std::span<const float>(upstream), "upstream"),
            u2(*stream_, std::span<const float>(by_number), "upstream");
        if (sorted) {
          device.begin_sorted(*stream_);
          launch(*stream_, taps, Contribute<C, KeepForSort>{{}, t.data(), u.data(), device.keep()});
          device.sum_sorted(*stream_, 8, static_cast<std::uint32_t>(sources), 1, u2.data(), sources);
        } else {
          launch(*stream_, taps, Contribute<C, AddNow>{{}, t.data(), u.data(), device.add()});
        }
        device.step(*stream_, 1e-2, scale.data(), counters.data(), counters.data() + 1);
      }
      std::vector<float> got(entries * C);
      SparseAdam state(entries, C, options_);
      device.download(got, &state);
      expect_same(got, table, sorted);
      expect_same({state.moments().begin(), state.moments().end()}, cpu.moments(), sorted);
      if (!dense) {
        EXPECT_TRUE(std::equal(cpu.counts().begin(), cpu.counts().end(), state.counts().begin()));
      }
      EXPECT_EQ(state.global_count(), cpu.global_count());
      EXPECT_EQ(counters.download()[0], static_cast<unsigned long long>(expected.non_finite));
      EXPECT_EQ(counters.download()[1], static_cast<unsigned long long>(expected.touched));
      // The halves follow the floats.
      std::vector<Half> halves(entries * C);
      stream_->download(halves.data(), device.halves(), halves.size() * sizeof(Half));
      for (std::size_t i = 0; i < halves.size(); ++i) ASSERT_EQ(halves[i].bits, to_half(got[i]).bits);
    }
  }
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
      options.sorted = sorted && training;
      options.slots = options.touches = 50'000;
      const std::size_t before = stream_->allocated_bytes();
      const DeviceTable table(*stream_, 100'000, 4, options, "test");
      const double took = static_cast<double>(stream_->allocated_bytes() - before);
      EXPECT_NEAR(total(DeviceTable::memory(100'000, 4, options, "test")), took, 0.05 * took + 5e5);
    }
  }
}

INSTANTIATE_TEST_SUITE_P(All, DeviceAdam, ::testing::Values(false, true), testing::stream_name);

}  // namespace
}  // namespace octrad
