#include <gtest/gtest.h>

#include "octrad/base/bytes.h"
#include "octrad/base/error.h"

namespace octrad {
namespace {

TEST(Bytes, ReadsAndFormats) {
  EXPECT_EQ(parse_bytes("4G"), 4ull << 30);
  EXPECT_EQ(parse_bytes("512M"), 512ull << 20);
  EXPECT_EQ(parse_bytes("1.5GiB"), 3ull << 29);
  EXPECT_EQ(parse_bytes("64 kb"), 65536u);
  EXPECT_EQ(parse_bytes("123"), 123u);
  for (const char* bad : {"", "G", "4X", "-1G", "4GG", "nan", "1e30T", "0x4G"})
    EXPECT_THROW(parse_bytes(bad), UsageError) << bad;
  EXPECT_EQ(format_bytes(73), "73 B");
  EXPECT_EQ(format_bytes(1270000000.0), "1.18 GiB");
  EXPECT_EQ(format_bytes(512.0 * 1024 * 1024), "512.0 MiB");
  EXPECT_EQ(format_count(12691), "12,691");
  EXPECT_EQ(format_count(-1000000), "-1,000,000");
  EXPECT_EQ(format_count(7), "7");
  EXPECT_EQ(format_three_digits(0.0625), "0.0625");
  EXPECT_EQ(format_three_digits(1.875), "1.88");
  EXPECT_EQ(format_three_digits(99.96), "100");
  EXPECT_EQ(format_three_digits(-1398.2), "-1398");
  EXPECT_EQ(format_rate(1234567), "1.23 M");
  EXPECT_EQ(format_rate(845000), "845 k");
}

TEST(Bytes, KnowsTheProcess) {
  EXPECT_GT(resident_bytes(), 1u << 20);
  EXPECT_GT(usable_memory(), resident_bytes());
}

TEST(Bytes, RefusesOverBudgetRequests) {
  const std::vector<MemoryPart> items = {{"networks", 1 << 20}, {"features", 1 << 30}};
  EXPECT_NO_THROW(require_memory(0, "x", items, ""));
  EXPECT_NO_THROW(require_memory(2u << 30, "x", items, ""));
  try {
    require_memory(1u << 30, "training", items, "octree.levels = 7 saves 0.9 GiB");
    FAIL() << "accepted";
  } catch (const MemoryError& error) {
    const std::string text = error.what();
    EXPECT_EQ(error.code(), ExitCode::out_of_memory);
    EXPECT_NE(text.find("--max-memory"), std::string::npos);
    EXPECT_LT(text.find("features"), text.find("networks"));
    EXPECT_NE(text.find("octree.levels = 7 saves"), std::string::npos);
  }
}

}  // namespace
}  // namespace octrad
