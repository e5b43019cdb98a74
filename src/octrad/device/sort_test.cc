// Sorting, scans and sums on every stream that this machine has.
#include "octrad/device/sort.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>
#include <vector>

#include "octrad/base/error.h"
#include "octrad/base/random_inputs.h"
#include "octrad/device/array.h"
#include "octrad/device/checks.h"
#include "octrad/device/stream_test_helper.h"

namespace octrad {
namespace {

class Sort : public testing::StreamTest {};

TEST_P(Sort, IsStableInTheBitsAskedFor) {
  for (const std::size_t n : {1, 2, 1000, 100'003}) {
    for (const int bits : {1, 5, 8, 9, 17, 24, 31, 32})
      EXPECT_TRUE(testing::passed(check_sort(*stream, n, bits, n))) << n << " items, " << bits << " bits";
  }
  EXPECT_EQ(check_sort(*stream, 0, 20, 1).items, 0u);
}

TEST_P(Sort, CanBeRecorded) {
  const std::size_t n = 5000;
  const SortWorkspace workspace(*stream, n, "sort");
  DeviceArray<std::uint32_t> keys(*stream, n, "keys"), sums(*stream, n, "sums");
  const DeviceArray<std::uint32_t> keys_out(*stream, n, "keys"), values_out(*stream, n, "values");
  const auto work = [&] {
    sort_pairs(*stream, workspace, n, keys.data(), keys_out.data(), keys.data(), values_out.data(), 20);
    exclusive_sum(*stream, workspace, n, keys_out.data(), sums.data());
  };
  keys.fill(0);
  work();
  const auto graph = stream->capture(work);
  for (std::uint64_t seed : {1u, 2u}) {
    std::vector<std::uint32_t> input = testing::random_words(n, seed), expected(n);
    keys.upload(input);
    stream->replay(*graph);
    std::ranges::stable_sort(input, {}, [](std::uint32_t key) { return key & 0xfffffu; });
    std::exclusive_scan(input.begin(), input.end(), expected.begin(), 0u);
    EXPECT_EQ(sums.download(), expected);
  }
}

TEST_P(Sort, ScansInPlaceAndWrapsAround) {
  for (const std::size_t n : {1, 33, 70'001}) EXPECT_TRUE(testing::passed(check_scan(*stream, n, 3))) << n;
}

TEST_P(Sort, SumsRepeatBitForBit) {
  for (const std::size_t n : {0, 1, 100, 200'000}) EXPECT_TRUE(testing::passed(check_sum(*stream, n, 9))) << n;
}

TEST_P(Sort, RefusesWhatDoesNotFit) {
  const SortWorkspace workspace(*stream, 10, "sort");
  const DeviceArray<std::uint32_t> data(*stream, 11, "data");
  EXPECT_THROW(exclusive_sum(*stream, workspace, 11, data.data(), data.data()), DeviceError);
  EXPECT_THROW(sort_pairs(*stream, workspace, 3, data.data(), data.data() + 3, data.data(), data.data() + 6, 33),
               DeviceError);
  EXPECT_THROW(sort_pairs(*stream, workspace, 3, data.data(), data.data() + 3, data.data(), data.data() + 6, 0),
               DeviceError);
}

INSTANTIATE_TEST_SUITE_P(All, Sort, ::testing::Bool(), testing::stream_name);

}  // namespace
}  // namespace octrad
