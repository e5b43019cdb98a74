#include <gtest/gtest.h>

#include <cfenv>
#include <thread>
#include <vector>

#include "octrad/base/threads.h"

namespace octrad {
namespace {

TEST(Threads, BlocksCoverEverythingOnce) {
  std::vector<int> seen(1003, 0);
  parallel_blocks(seen.size(), 64, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) ++seen[i];
  });
  for (const int n : seen) EXPECT_EQ(n, 1);
}

TEST(Threads, LoopsHaveTheFloatingPointModeOfTheirCaller) {
  std::thread([] {
    const auto modes = [] {
      std::vector<int> seen(1000);
      parallel_for(seen.size(), [&](std::size_t i) { seen[i] = std::fegetround(); });
      return seen;
    };
    std::fesetround(FE_UPWARD);
    EXPECT_EQ(modes(), std::vector<int>(1000, FE_UPWARD));
    std::fesetround(FE_TONEAREST);
    EXPECT_EQ(modes(), std::vector<int>(1000, FE_TONEAREST)) << "the mode of the first loop was kept";
  }).join();
}

}  // namespace
}  // namespace octrad
