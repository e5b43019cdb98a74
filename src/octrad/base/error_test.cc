#include <gtest/gtest.h>

#include "octrad/base/error.h"

namespace octrad {
namespace {

TEST(Error, SuggestsTheClosestName) {
  const std::vector<std::string> names = {"octree.levels", "octree.features", "train", "render", "roughplastic"};
  EXPECT_EQ(did_you_mean("octree.level", names), " (did you mean \"octree.levels\"?)");
  EXPECT_EQ(did_you_mean("levels", names), " (did you mean \"octree.levels\"?)");
  EXPECT_EQ(did_you_mean("redner", names), " (did you mean \"render\"?)");
  EXPECT_EQ(did_you_mean("TRAIN", names), " (did you mean \"train\"?)");
  EXPECT_EQ(did_you_mean("zebra", names), "");
  EXPECT_EQ(did_you_mean("", names), "");
  EXPECT_EQ(did_you_mean("x", {}), "");
  const std::vector<std::string> channels = {"R", "G", "B", "depth.Z", "roughness.Y"};
  EXPECT_EQ(did_you_mean("Z", channels), " (did you mean \"depth.Z\"?)");
  EXPECT_EQ(did_you_mean("r", channels), " (did you mean \"R\"?)");
  EXPECT_EQ(did_you_mean("Q", channels), "");
}

}  // namespace
}  // namespace octrad
