#include <gtest/gtest.h>
#include <signal.h>
#include <sys/resource.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <thread>

#include "octrad/base/error.h"
#include "octrad/base/folder_test_helper.h"
#include "octrad/base/input_file.h"
#include "octrad/base/log.h"
#include "octrad/base/progress.h"
#include "octrad/base/stopwatch.h"

namespace octrad {
namespace {

TEST(JsonLines, CanBeFollowedAndAppended) {
  const TestFolder folder;
  const auto path = [&](const std::string& name) { return folder.file(name); };
  {
    JsonLines log(path("log"));
    std::vector<std::thread> threads;
    for (int t = 0; t < 4; ++t) {
      threads.emplace_back([&log, t] {
        for (int i = 0; i < 50; ++i) log.write({{"thread", t}, {"i", i}, {"loss", std::nan("")}});
      });
    }
    for (std::thread& thread : threads) thread.join();
  }
  {
    JsonLines more(path("log"), true);
    more.write({{"last", true}});
  }
  std::ifstream in(path("log"));
  int lines = 0;
  for (std::string line; std::getline(in, line); ++lines) EXPECT_TRUE(nlohmann::json::accept(line)) << line;
  EXPECT_EQ(lines, 201);
  // A line that broke off, with the machine, is cut away; so is a file that has no whole line.
  for (const std::string& broken : {std::string("{\"a\":1}\n{\"b"), "{\"c" + std::string(10000, ' ')}) {
    std::ofstream(path("broken")) << broken;
    JsonLines(path("broken"), true).write({{"d", 2}});
    EXPECT_EQ(read_file(path("broken")), (broken[2] == 'a' ? "{\"a\":1}\n" : "") + std::string("{\"d\":2}\n"));
  }
  std::ofstream(path("notes")) << "mine";
  JsonLines(path("notes"), true).write({{"d", 2}});
  EXPECT_EQ(read_file(path("notes")), "mine\n{\"d\":2}\n");
  EXPECT_THROW(JsonLines(path("none/log")), IoError);
}

// The work must go on without its log, and say so at the end.
TEST(JsonLines, LinesThatCannotBeWrittenAreTriedAgain) {
  const TestFolder folder;
  const std::string file = folder.file("log");
  JsonLines log(file);
  log.write({{"line", 1}});
  signal(SIGXFSZ, SIG_IGN);
  rlimit before{};
  ASSERT_EQ(getrlimit(RLIMIT_FSIZE, &before), 0);
  rlimit limit = before;
  limit.rlim_cur = std::filesystem::file_size(file) + 5;  // a piece of the next line
  ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &limit), 0);
  log.write({{"line", 2}});
  log.write({{"line", 3}});
  setrlimit(RLIMIT_FSIZE, &before);
  log.write({{"line", 4}});
  std::ifstream in(file);
  std::string text((std::istreambuf_iterator<char>(in)), {});
  EXPECT_EQ(text, "{\"line\":1}\n{\"line\":4}\n");
  try {
    log.finish();
    ADD_FAILURE() << "two lines are missing";
  } catch (const IoError& error) {
    EXPECT_NE(std::string(error.what()).find("2 of its lines"), std::string::npos) << error.what();
  }
}

TEST(JsonLines, OneWarningForAllLines) {
  JsonLines log("/dev/full");
  testing::internal::CaptureStderr();
  for (int i = 0; i < 3; ++i) log.write({{"line", i}});
  const std::string warnings = testing::internal::GetCapturedStderr();
  EXPECT_EQ(std::count(warnings.begin(), warnings.end(), '\n'), 1) << warnings;
  EXPECT_NE(warnings.find("/dev/full"), std::string::npos) << warnings;
  EXPECT_THROW(log.finish(), IoError);
}

TEST(Progress, EstimatesFromWhereItStarted) {
  set_log_level(LogLevel::normal);
  Progress progress("test");
  EXPECT_LT(progress.remaining(0.5), 0.0) << "nothing known before the first update";
  testing::internal::CaptureStderr();
  const Stopwatch longer;
  progress.update(0.5, "resumed");
  const Stopwatch shorter;
  std::this_thread::sleep_for(std::chrono::milliseconds(40));
  const double least = shorter.seconds(), left = progress.remaining(0.75), most = longer.seconds();
  EXPECT_GE(left, least - 1e-9);  // half of what was left took that long
  EXPECT_LE(left, most + 1e-9);
  progress.update(0.75, "forced", true);
  progress.update(0.8, "known", true, 3660.0);
  progress.finish();
  const std::string text = testing::internal::GetCapturedStderr();
  EXPECT_NE(text.find("test"), std::string::npos) << text;
  EXPECT_NE(text.find("forced"), std::string::npos) << text;
  EXPECT_NE(text.find("ETA 1h 01m  known"), std::string::npos) << text;
}

}  // namespace
}  // namespace octrad
