#include <gtest/gtest.h>

#include "octrad/base/duration.h"
#include "octrad/base/error.h"

namespace octrad {
namespace {

TEST(Duration, ReadsWhatPeopleWrite) {
  EXPECT_DOUBLE_EQ(parse_duration("90"), 90.0);
  EXPECT_DOUBLE_EQ(parse_duration("3s"), 3.0);
  EXPECT_DOUBLE_EQ(parse_duration("2m"), 120.0);
  EXPECT_DOUBLE_EQ(parse_duration("1.5h"), 5400.0);
  EXPECT_DOUBLE_EQ(parse_duration("1h30m"), 5400.0);
  EXPECT_DOUBLE_EQ(parse_duration("250ms"), 0.25);
  EXPECT_DOUBLE_EQ(parse_duration("0"), 0.0);
  for (const char* bad : {"", " ", "abc", "-3s", "3x", "nan", "inf", "0x10", "1m1h", "2m2m", "3s ", "m", "1e999"}) {
    EXPECT_THROW(parse_duration(bad), UsageError) << bad;
  }
}

TEST(Duration, FormatsShortly) {
  EXPECT_EQ(format_duration(0.0425), "42 ms");
  EXPECT_EQ(format_duration(4.2), "4.2 s");
  EXPECT_EQ(format_duration(59.96), "1m 00s");
  EXPECT_EQ(format_duration(185), "3m 05s");
  EXPECT_EQ(format_duration(7620), "2h 07m");
  EXPECT_EQ(format_duration(-1), "?");
}

}  // namespace
}  // namespace octrad
