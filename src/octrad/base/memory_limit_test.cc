#include "octrad/base/memory_limit.h"

#include <gtest/gtest.h>

#include <thread>
#include <vector>

#include "octrad/base/bytes.h"
#include "octrad/base/error.h"

namespace octrad {
namespace {

constexpr std::uint64_t kMega = 1 << 20;

class MemoryLimit : public ::testing::Test {
 protected:
  // 200 MB are left.
  void SetUp() override { set_memory_limit(resident_bytes() + 200 * kMega); }
  void TearDown() override { set_memory_limit(0); }
};

bool refused(std::uint64_t bytes) {
  try {
    ask_memory(bytes, "a thing");
  } catch (const MemoryError& error) {
    EXPECT_NE(std::string(error.what()).find("a thing needs "), std::string::npos) << error.what();
    EXPECT_NE(std::string(error.what()).find("--max-memory"), std::string::npos) << error.what();
    return true;
  }
  return false;
}

TEST_F(MemoryLimit, RefusesWhatIsAboveIt) {
  EXPECT_FALSE(refused(100 * kMega));
  EXPECT_FALSE(refused(100 * kMega)) << "without a scope nothing is remembered";
  EXPECT_TRUE(refused(300 * kMega));
  EXPECT_TRUE(refused(~std::uint64_t{0})) << "no overflow";
  set_memory_limit(0);
  EXPECT_FALSE(refused(~std::uint64_t{0})) << "no limit";
}

TEST_F(MemoryLimit, PromisesCountUntilTheScopeEnds) {
  {
    const MemoryScope scope;
    EXPECT_FALSE(refused(150 * kMega));
    EXPECT_TRUE(refused(100 * kMega));
    {
      const MemoryScope inner;
      EXPECT_FALSE(refused(20 * kMega));
    }
    bool other = false;
    std::thread([&] {
      const MemoryScope scope_of_another_thread;
      other = refused(100 * kMega);
    }).join();
    EXPECT_TRUE(other) << "promised to the first thread";
  }
  EXPECT_FALSE(refused(100 * kMega));
}

TEST_F(MemoryLimit, MemoryThatIsThereCountsOnce) {
  const MemoryScope scope;
  ASSERT_FALSE(refused(100 * kMega));
  const std::vector<char> memory(100 * kMega, 'x');  // what was asked for
  EXPECT_EQ(memory.back(), 'x');
  EXPECT_FALSE(refused(60 * kMega));
  EXPECT_TRUE(refused(120 * kMega));
}

TEST_F(MemoryLimit, SmallThingsAddUp) {
  const MemoryScope scope;
  MemoryMeter meter("small things");
  std::uint64_t asked = 0;
  EXPECT_THROW(for (; asked < 300 * kMega; asked += 1000) meter.add(1000), MemoryError);
  EXPECT_GT(asked, 180 * kMega);
  EXPECT_LT(asked, 210 * kMega);
}

}  // namespace
}  // namespace octrad
