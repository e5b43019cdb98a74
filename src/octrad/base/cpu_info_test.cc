#include <gtest/gtest.h>

#include "octrad/base/cpu_info.h"

namespace octrad {
namespace {

TEST(CpuInfo, IsFilledIn) {
  const CpuInfo info = cpu_info();
  EXPECT_GE(info.logical_cores, 1);
  EXPECT_FALSE(info.level.empty());
}

}  // namespace
}  // namespace octrad
