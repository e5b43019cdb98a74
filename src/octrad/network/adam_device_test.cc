// Optimisers on the device take the steps of those on the CPU.
#include <gtest/gtest.h>

#include <vector>

#include "octrad/device/stream_test_helper.h"
#include "octrad/network/adam_device.h"
#include "octrad/network/checks.h"

namespace octrad {
namespace {

class DeviceAdam : public testing::StreamTest {};

TEST_P(DeviceAdam, StepsAreThoseOfTheCpu) {
  EXPECT_TRUE(testing::passed(check_adam_update(*stream, 5000, 1)));
  EXPECT_TRUE(testing::passed(check_dense_adam(*stream, 5000, 2)));
  for (const TableMode mode : {TableMode::touched, TableMode::dense, TableMode::dense_half_moments})
    EXPECT_TRUE(testing::passed(check_table_adam(*stream, 300, mode, 3))) << static_cast<int>(mode);
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
