// Sorting, scans and sums on every stream that this machine has.
#include "octrad/device/sort.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <vector>

#include "octrad/base/error.h"
#include "octrad/base/rng.h"
#include "octrad/device/stream_test_helper.h"

namespace octrad {
namespace {

using Words = std::vector<std::uint32_t>;

Words random_words(std::size_t n, std::uint64_t seed) {
  Words words(n);
  for (std::size_t i = 0; i < n; ++i) words[i] = Rng(seed, RngPurpose::test, i).bits();
  return words;
}

// What std::stable_sort makes of keys cut to their low bits; values are the places that the keys had.
Words expected_order(const Words& keys, int bits) {
  const std::uint32_t mask = bits == 32 ? ~0u : (1u << bits) - 1u;
  Words order(keys.size());
  std::iota(order.begin(), order.end(), 0u);
  std::stable_sort(order.begin(), order.end(),
                   [&](std::uint32_t a, std::uint32_t b) { return (keys[a] & mask) < (keys[b] & mask); });
  return order;
}

class Sort : public ::testing::TestWithParam<bool> {};

TEST_P(Sort, IsStableInTheBitsAskedFor) {
  const auto stream = testing::stream_or_skip(GetParam());
  if (!stream) GTEST_SKIP() << testing::kNoDevice;
  const SortWorkspace workspace(*stream, 100'003, "sort");
  for (const std::size_t n :
       {std::size_t{0}, std::size_t{1}, std::size_t{2}, std::size_t{1000}, std::size_t{100'003}}) {
    const Words keys = random_words(n, n);
    Words places(n);
    std::iota(places.begin(), places.end(), 0u);
    const DeviceArray<std::uint32_t> keys_in(*stream, std::span<const std::uint32_t>(keys), "keys");
    const DeviceArray<std::uint32_t> values_in(*stream, std::span<const std::uint32_t>(places), "values");
    const DeviceArray<std::uint32_t> keys_out(*stream, n, "keys"), values_out(*stream, n, "values");
    for (const int bits : {1, 5, 8, 9, 17, 24, 31, 32}) {
      sort_pairs(*stream, workspace, n, keys_in.data(), keys_out.data(), values_in.data(), values_out.data(), bits);
      const Words order = expected_order(keys, bits);
      ASSERT_EQ(values_out.download(), order) << n << " items, " << bits << " bits";
      const Words sorted = keys_out.download();
      for (std::size_t i = 0; i < n; ++i) ASSERT_EQ(sorted[i], keys[order[i]]) << i;
      ASSERT_EQ(keys_in.download(), keys) << "inputs stay";
    }
  }
}

TEST_P(Sort, CanBeRecorded) {
  const auto stream = testing::stream_or_skip(GetParam());
  if (!stream) GTEST_SKIP() << testing::kNoDevice;
  const std::size_t n = 5000;
  const SortWorkspace workspace(*stream, n, "sort");
  DeviceArray<std::uint32_t> keys(*stream, n, "keys"), sums(*stream, n, "sums");
  const DeviceArray<std::uint32_t> keys_out(*stream, n, "keys"), values_out(*stream, n, "values");
  const auto graph = stream->capture([&] {
    sort_pairs(*stream, workspace, n, keys.data(), keys_out.data(), keys.data(), values_out.data(), 20);
    exclusive_sum(*stream, workspace, n, keys_out.data(), sums.data());
  });
  for (std::uint64_t seed : {1u, 2u}) {
    const Words input = random_words(n, seed);
    keys.upload(input);
    stream->replay(*graph);
    const Words order = expected_order(input, 20);
    Words expected(n);
    std::uint32_t total = 0;
    for (std::size_t i = 0; i < n; ++i) {
      expected[i] = total;
      total += input[order[i]];
    }
    EXPECT_EQ(sums.download(), expected);
  }
}

TEST_P(Sort, ScansInPlaceAndWrapsAround) {
  const auto stream = testing::stream_or_skip(GetParam());
  if (!stream) GTEST_SKIP() << testing::kNoDevice;
  for (const std::size_t n : {std::size_t{1}, std::size_t{33}, std::size_t{70'001}}) {
    const SortWorkspace workspace(*stream, n, "scan");
    const Words input = random_words(n, 3);
    const DeviceArray<std::uint32_t> data(*stream, std::span<const std::uint32_t>(input), "data");
    exclusive_sum(*stream, workspace, n, data.data(), data.data());
    Words expected(n);
    std::exclusive_scan(input.begin(), input.end(), expected.begin(), 0u);
    EXPECT_EQ(data.download(), expected);
  }
}

TEST_P(Sort, SumsRepeatBitForBit) {
  const auto stream = testing::stream_or_skip(GetParam());
  if (!stream) GTEST_SKIP() << testing::kNoDevice;
  for (const std::size_t n : {std::size_t{0}, std::size_t{1}, std::size_t{100}, std::size_t{200'000}}) {
    const SortWorkspace workspace(*stream, n, "sum");
    std::vector<float> input(n);
    for (std::size_t i = 0; i < n; ++i) input[i] = Rng(9, RngPurpose::test, i).uniform();
    const DeviceArray<float> in(*stream, std::span<const float>(input), "in");
    const DeviceArray<float> out(*stream, 2, "out");
    sum(*stream, workspace, n, in.data(), out.data());
    sum(*stream, workspace, n, in.data(), out.data() + 1);
    const std::vector<float> result = out.download();
    const double expected = std::accumulate(input.begin(), input.end(), 0.0);
    EXPECT_NEAR(result[0], expected, 1e-6 * expected);
    EXPECT_EQ(result[0], result[1]);
  }
}

TEST_P(Sort, RefusesWhatDoesNotFit) {
  const auto stream = testing::stream_or_skip(GetParam());
  if (!stream) GTEST_SKIP() << testing::kNoDevice;
  const SortWorkspace workspace(*stream, 10, "sort");
  const DeviceArray<std::uint32_t> data(*stream, 11, "data");
  EXPECT_THROW(exclusive_sum(*stream, workspace, 11, data.data(), data.data()), DeviceError);
  EXPECT_THROW(sort_pairs(*stream, workspace, 3, data.data(), data.data() + 3, data.data(), data.data() + 6, 33),
               DeviceError);
  EXPECT_THROW(sort_pairs(*stream, workspace, 3, data.data(), data.data() + 3, data.data(), data.data() + 6, 0),
               DeviceError);
}

INSTANTIATE_TEST_SUITE_P(All, Sort, ::testing::Values(false, true), testing::stream_name);

}  // namespace
}  // namespace octrad
