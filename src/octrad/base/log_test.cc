#include <gtest/gtest.h>

#include "octrad/base/log.h"

namespace octrad {
namespace {

TEST(Log, LevelsDecideWhatIsShown) {
  testing::internal::CaptureStderr();
  set_log_level(LogLevel::quiet);
  log_info("info {}", 1);
  log_warning("warning");
  log_error("error");
  set_log_level(LogLevel::verbose);
  log_verbose("detail {}", 2);
  set_log_level(LogLevel::normal);
  const std::string text = testing::internal::GetCapturedStderr();
  EXPECT_EQ(text, "octrad: warning: warning\noctrad: error: error\ndetail 2\n");
}

}  // namespace
}  // namespace octrad
