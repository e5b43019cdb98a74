#include <gtest/gtest.h>

#include <limits>

#include "octrad/base/vec.h"

namespace octrad {
namespace {

TEST(Numbers, LesserAndGreaterPassOverNan) {
  static_assert(lesser(2, 3) == 2 && greater(2.0, 3.0) == 3.0);
  EXPECT_EQ(lesser(-1.0f, 2.0f), -1.0f);
  EXPECT_EQ(greater(-1.0f, 2.0f), 2.0f);
  EXPECT_EQ(lesser(std::numeric_limits<float>::quiet_NaN(), 2.0f), 2.0f);
  EXPECT_EQ(greater(std::numeric_limits<double>::quiet_NaN(), 2.0), 2.0);
}

}  // namespace
}  // namespace octrad
