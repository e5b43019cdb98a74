#include "octrad/device/tuning_keys.h"

#include <gtest/gtest.h>

#include "octrad/base/error.h"

namespace octrad {
namespace {

std::string error_of(const std::string& key, const std::string& value) {
  DeviceTuning tuning;
  try {
    set(tuning, key, value);
  } catch (const UsageError& error) {
    EXPECT_EQ(tuning, DeviceTuning{});
    return error.what();
  }
  return "";
}

TEST(Tuning, EveryKeyChangesItsOwnValue) {
  DeviceTuning all;
  for (const std::string& key : tuning_keys()) {
    DeviceTuning one;
    int changes = 0;
    for (const char* value : {"0", "1", "32"}) {
      const std::string text = value, error = error_of(key, text);
      if (!error.empty()) continue;
      set(one, key, text);
      set(all, key, text);
      changes += one == DeviceTuning{} ? 0 : 1;
    }
    EXPECT_GT(changes, 0) << key;
  }
  EXPECT_EQ(all.cast_refill, 32);
  EXPECT_TRUE(all.half_moments && all.scan_touched && all.pixel_tiles);
  set(all, "pixel_tiles", "0");
  EXPECT_FALSE(all.pixel_tiles);
}

TEST(Tuning, SaysWhatIsWrong) {
  EXPECT_NE(error_of("cast_warp", "1").find("cast_warps"), std::string::npos) << "a suggestion";
  EXPECT_NE(error_of("cast_refill", "33").find("from 1 to 32"), std::string::npos);
  EXPECT_NE(error_of("cast_refill", "8.5").find("a whole number"), std::string::npos);
  EXPECT_NE(error_of("block", "48").find("a multiple of 32"), std::string::npos);
  EXPECT_NE(error_of("half_moments", "yes"), "");
}

}  // namespace
}  // namespace octrad
