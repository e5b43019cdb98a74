#include <gtest/gtest.h>

#include <cfenv>
#include <thread>
#include <vector>

#include "octrad/base/error.h"
#include "octrad/base/threads.h"

namespace octrad {
namespace {

TEST(Threads, BlocksCoverEverythingOnce) {
  std::vector<int> seen(1003, 0);
  parallel_blocks(seen.size(), 64, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) ++seen[i];
  });
  for (const int n : seen) EXPECT_EQ(n, 1);
  int calls = 0;
  parallel_blocks(0, 64, [&](std::size_t, std::size_t) { ++calls; });
  EXPECT_EQ(calls, 0);
}

TEST(Threads, LoopsInLoopsCoverEverythingOnce) {
  std::vector<int> seen(20 * 30, 0);
  parallel_for(20, [&](std::size_t i) { parallel_for(30, [&, i](std::size_t j) { ++seen[i * 30 + j]; }); });
  EXPECT_EQ(seen, std::vector<int>(seen.size(), 1));
}

TEST(Threads, ExceptionsReachTheCaller) {
  for (const int threads : {1, 0}) {
    set_thread_count(threads);
    EXPECT_THROW(parallel_for(100,
                              [](std::size_t i) {
                                if (i == 57) throw InputError("57");
                              }),
                 InputError);
  }
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
