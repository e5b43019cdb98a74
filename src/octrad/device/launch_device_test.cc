// launch(), arrays and recorded graphs on every stream that this machine has.
#include <gtest/gtest.h>

#include <memory>
#include <numeric>
#include <vector>

#include "octrad/base/error.h"
#include "octrad/device/array.h"
#include "octrad/device/checks.h"
#include "octrad/device/launch.h"
#include "octrad/device/stage_times.h"
#include "octrad/device/stream_test_helper.h"

namespace octrad {
namespace {

struct Affine : Kernel {
  const float* in;
  float* out;
  float scale;
  OCTRAD_HD void operator()(std::uint32_t i) const { out[i] = scale * in[i] + 1.0f; }
};

struct CountLevels : Kernel {
  std::uint32_t* counts;  // [levels][n]
  std::uint32_t n;
  OCTRAD_HD void operator()(std::uint32_t level, std::uint32_t i) const {
    atomic_add(&counts[level * n + i], level + 1);
  }
};

class Streams : public testing::StreamTest {};

TEST_P(Streams, LaunchesWriteEveryItemOnce) {
  for (const std::size_t n :
       {std::size_t{0}, std::size_t{1}, std::size_t{127}, std::size_t{128}, std::size_t{100'001}}) {
    std::vector<float> values(n);
    std::iota(values.begin(), values.end(), 0.0f);
    const DeviceArray<float> in(*stream, std::span<const float>(values), "in");
    DeviceArray<float> out(*stream, n, "out");
    out.fill(0xff);
    launch(*stream, n, Affine{{}, in.data(), out.data(), 2.0f});
    const std::vector<float> result = out.download();
    ASSERT_EQ(result.size(), n);
    for (std::size_t i = 0; i < n; ++i) ASSERT_EQ(result[i], 2.0f * static_cast<float>(i) + 1.0f) << i;
  }
}

TEST_P(Streams, LaunchesOfLevelsMeetEveryItemOfEachOnce) {
  for (const std::uint32_t n : {1u, 127u, 129u, 5000u}) {
    constexpr int kLevels = 9;
    DeviceArray<std::uint32_t> counts(*stream, std::size_t{kLevels} * n, "counts");
    counts.fill(0);
    launch_levels(*stream, n, kLevels, CountLevels{{}, counts.data(), n});
    launch_levels(*stream, n, 0, CountLevels{{}, counts.data(), n});
    launch_levels(*stream, 0, kLevels, CountLevels{{}, counts.data(), n});
    const std::vector<std::uint32_t> result = counts.download();
    for (std::uint32_t i = 0; i < kLevels * n; ++i) ASSERT_EQ(result[i], i / n + 1) << i;
  }
}

struct CountItems : Kernel {
  std::uint32_t* counts;
  OCTRAD_HD void operator()(std::uint32_t i) const { atomic_add(&counts[i], 1u); }
};

TEST_P(Streams, PartsMeetEveryItemOfEachOnce) {
  const std::vector<std::size_t> sizes{0, 1, 127, 300, 0, 1, 1, 129, 5000, 3, 0};  // more than go into a launch
  DeviceArray<std::uint32_t> counts(*stream, 10'000, "counts");
  const auto begin_of = [&](std::size_t k) {  // with a gap between parts
    return std::accumulate(sizes.begin(), sizes.begin() + static_cast<std::ptrdiff_t>(k), std::size_t{0}) + 10 * k;
  };
  std::vector<LaunchPart<CountItems>> parts;
  for (std::size_t k = 0; k < sizes.size(); ++k) parts.push_back({sizes[k], {{}, counts.data() + begin_of(k)}});
  const auto all = [&] { launch_parts(*stream, parts.data(), parts.size()); };
  std::vector<std::uint32_t> expected(counts.size(), 0);
  for (std::size_t k = 0; k < sizes.size(); ++k) {
    for (std::size_t i = 0; i < sizes[k]; ++i) expected[begin_of(k) + i] = 1;
  }
  counts.fill(0);
  all();
  EXPECT_EQ(counts.download(), expected);
  EXPECT_EQ(stream->capture(all)->size(), 2u);
  EXPECT_EQ(stream->capture([&] { launch_parts<CountItems>(*stream, nullptr, 0); })->size(), 0u);
}

TEST_P(Streams, ListsHoldWhatWasAppended) {
  for (const std::size_t n : {1, 31, 33, 80'000}) EXPECT_TRUE(testing::passed(check_appends(*stream, n, n)));
}

TEST_P(Streams, AtomicsLoseNothing) { EXPECT_TRUE(testing::passed(check_atomics(*stream, 80'000, 1))); }

TEST_P(Streams, RandomNumbersAreThoseOfTheCpu) {
  EXPECT_TRUE(testing::passed(check_random_numbers(*stream, 20'000, 2)));
  EXPECT_TRUE(testing::passed(check_sobol(*stream, 20'000)));
}

TEST_P(Streams, GraphsReplayWhatWasRecorded) {
  const std::vector<float> start(1000, 1.0f);
  DeviceArray<float> a(*stream, std::span<const float>(start), "a");
  const DeviceArray<float> other(*stream, 1, "b");
  launch(*stream, 1, Affine{{}, a.data(), other.data(), 2.0f});  // kernels must have run before
  const auto graph = stream->capture([&] {
    launch(*stream, a.size(), Affine{{}, a.data(), a.data(), 2.0f});
    launch(*stream, a.size(), Affine{{}, a.data(), a.data(), 3.0f});
  });
  EXPECT_EQ(graph->size(), 2u);
  EXPECT_EQ(a.download()[0], 1.0f) << "recording must not run";
  for (int i = 0; i < 3; ++i) stream->replay(*graph);
  float expected = 1.0f;
  for (int i = 0; i < 3; ++i) expected = 3.0f * (2.0f * expected + 1.0f) + 1.0f;
  EXPECT_EQ(a.download()[999], expected);
}

// What a device refuses while it records, the host stream refuses too.
TEST_P(Streams, RecordingAllowsNothingElse) {
  const std::vector<float> start(10, 1.0f);
  DeviceArray<float> a(*stream, std::span<const float>(start), "a");
  const DeviceArray<float> other(*stream, 1, "b");
  launch(*stream, 1, Affine{{}, a.data(), other.data(), 2.0f});
  const auto graph = stream->capture([&] { launch(*stream, a.size(), Affine{{}, a.data(), a.data(), 2.0f}); });
  const auto second = stream->capture([&] {
    EXPECT_THROW(stream->capture([] {}), DeviceError);
    EXPECT_THROW(DeviceArray<float>(*stream, 1, "b"), DeviceError);
    EXPECT_THROW(a.upload(std::span<const float>(start)), DeviceError);
    EXPECT_THROW(a.download(), DeviceError);
    EXPECT_THROW(stream->synchronize(), DeviceError);
    EXPECT_THROW(stream->record(), DeviceError);
    EXPECT_THROW(stream->replay(*graph), DeviceError);
    launch(*stream, a.size(), Affine{{}, a.data(), a.data(), 3.0f});
  });
  stream->replay(*graph);
  stream->replay(*second);
  EXPECT_EQ(a.download()[9], 10.0f) << "refusals must not spoil what is recorded";
}

TEST_P(Streams, FailuresWhileRecordingLeaveTheStreamAsItWas) {
  {
    const std::vector<float> start(10, 1.0f);
    DeviceArray<float> a(*stream, std::span<const float>(start), "a");
    const DeviceArray<float> other(*stream, 1, "b");
    launch(*stream, 1, Affine{{}, a.data(), other.data(), 2.0f});
    EXPECT_THROW(stream->capture([&] {
      launch(*stream, a.size(), Affine{{}, a.data(), a.data(), 2.0f});
      a.download();
    }),
                 DeviceError);
    EXPECT_EQ(a.download()[3], 1.0f);
    launch(*stream, a.size(), Affine{{}, a.data(), a.data(), 2.0f});
    EXPECT_EQ(a.download()[3], 3.0f);
  }
  EXPECT_EQ(stream->allocated_bytes(), 0u);
}

// On a device the first launch of a kernel loads it; the host stream sees to it that no graph records that.
TEST(HostStreams, KernelsOfAGraphMustHaveRun) {
  const auto stream = make_host_stream();
  const DeviceArray<float> a(*stream, 10, "a");
  const auto work = [&] { launch(*stream, a.size(), Affine{{}, a.data(), a.data(), 2.0f}); };
  EXPECT_THROW(stream->capture(work), DeviceError);
  work();
  EXPECT_NO_THROW(stream->capture(work));
}

// Items are numbered in 32 bits.
TEST_P(Streams, TooManyItemsAreRefused) {
  EXPECT_THROW(launch(*stream, std::size_t{1} << 32, Affine{{}, nullptr, nullptr, 1.0f}), DeviceError);
}

// New memory holds no zeros that a device would not have: with assertions on, the host stream's holds NaNs.
TEST(HostStreams, NewMemoryIsNotZero) {
#if defined(NDEBUG)
  GTEST_SKIP() << "SKIPPED: assertions are off";
#else
  const auto stream = make_host_stream();
  const DeviceArray<float> a(*stream, 1000, "a");
  for (const float v : a.download()) ASSERT_TRUE(v != v);
#endif
}

TEST_P(Streams, MemoryIsCountedAndGivenBack) {
  {
    DeviceArray<double> a(*stream, 1000, "a");
    EXPECT_EQ(stream->allocated_bytes(), 8000u);
    const DeviceArray<double> b = std::move(a);
    EXPECT_EQ(stream->allocated_bytes(), 8000u);
    EXPECT_EQ(b.size(), 1000u);
  }
  EXPECT_EQ(stream->allocated_bytes(), 0u);
  EXPECT_EQ(stream->peak_bytes(), 8000u);
  EXPECT_THROW(stream->allocate(std::size_t{1} << 60, "far too much"), MemoryError);
}

TEST_P(Streams, EventsMeasureTime) {
  const auto start = stream->record();
  DeviceArray<float> a(*stream, 1 << 20, "a");
  a.fill(0);
  const auto end = stream->record();
  const double ms = stream->milliseconds(*start, *end);
  EXPECT_GE(ms, 0.0);
  EXPECT_LT(ms, 10'000.0);
}

TEST_P(Streams, StagesAreTimedInTheirOrder) {
  StageTimes times(*stream);
  times.settle();
  EXPECT_TRUE(times.means().empty());
  DeviceArray<float> a(*stream, 1 << 20, "a");
  const auto pass = [&](int fills) {
    times.begin();
    for (int i = 0; i < fills; ++i) a.fill(i);
    stream->mark("fill");
    stream->mark("nothing");
    times.end();
    stream->mark("not listened to");
  };
  pass(1000);
  times.forget();
  for (int i = 0; i < 3; ++i) {
    pass(200);
    times.settle();
  }
  for (const StageSplit& split : {times.means(), times.medians()}) {
    ASSERT_EQ(split.size(), 2u);
    EXPECT_EQ(split[0].first, "fill");
    EXPECT_EQ(split[1].first, "nothing");
    EXPECT_GT(split[0].second, split[1].second);
    EXPECT_GE(split[1].second, 0.0);
  }
}

INSTANTIATE_TEST_SUITE_P(All, Streams, ::testing::Bool(), testing::stream_name);

TEST(Devices, SurveySaysWhyThereIsNone) {
  const DeviceSurvey survey = survey_devices();
  if (survey.devices.empty()) {
    EXPECT_FALSE(survey.why_none.empty());
    try {
      make_cuda_stream(0);
      FAIL() << "a stream without a device";
    } catch (const DeviceError& error) {
      EXPECT_EQ(error.what(), survey.why_none);
      EXPECT_EQ(error.code(), ExitCode::device);
    }
  } else {
    EXPECT_THROW(make_cuda_stream(static_cast<int>(survey.devices.size())), DeviceError);
    EXPECT_GT(survey.devices[0].total_bytes, std::size_t{1} << 28);
  }
}

}  // namespace
}  // namespace octrad
