#include <fcntl.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cfenv>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <limits>
#include <nlohmann/json.hpp>
#include <thread>

#include "octrad/base/atomic_file.h"
#include "octrad/base/bytes.h"
#include "octrad/base/cpu_info.h"
#include "octrad/base/duration.h"
#include "octrad/base/error.h"
#include "octrad/base/interrupt.h"
#include "octrad/base/log.h"
#include "octrad/base/progress.h"
#include "octrad/base/threads.h"
#include "octrad/base/vec.h"

namespace octrad {
namespace {

class BaseFiles : public ::testing::Test {
 protected:
  BaseFiles() {
    std::string pattern = (std::filesystem::temp_directory_path() / "octrad-base-XXXXXX").string();
    folder_ = mkdtemp(pattern.data());
  }
  ~BaseFiles() override { std::filesystem::remove_all(folder_); }
  std::string path(const std::string& name) const { return (folder_ / name).string(); }
  std::filesystem::path folder_;
};

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

TEST(Numbers, LesserAndGreaterPassOverNan) {
  static_assert(lesser(2, 3) == 2 && greater(2.0, 3.0) == 3.0);
  EXPECT_EQ(lesser(-1.0f, 2.0f), -1.0f);
  EXPECT_EQ(greater(-1.0f, 2.0f), 2.0f);
  EXPECT_EQ(lesser(std::numeric_limits<float>::quiet_NaN(), 2.0f), 2.0f);
  EXPECT_EQ(greater(std::numeric_limits<double>::quiet_NaN(), 2.0), 2.0);
}

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
  EXPECT_EQ(format_rate(1234567), "1.23 M");
  EXPECT_EQ(format_rate(845000), "845 k");
}

TEST(Bytes, KnowsTheProcess) {
  EXPECT_GT(resident_bytes(), 1u << 20);
  EXPECT_GE(peak_resident_bytes() + (1u << 20), resident_bytes());
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

TEST_F(BaseFiles, AtomicFileReplacesOrLeaves) {
  write_text_file(path("a"), "old");
  {
    AtomicFile out(path("a"));
    out.write(std::string("half"));
  }  // no commit
  EXPECT_EQ(read_text_file(path("a")), "old");
  write_text_file(path("a"), "new");
  EXPECT_EQ(read_text_file(path("a")), "new");
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder_), std::filesystem::directory_iterator()), 1);
}

TEST_F(BaseFiles, AtomicFilesOfTwoWritersNeverMix) {
  write_text_file(path("a.tmp"), "somebody's own");
  {
    AtomicFile one(path("a")), two(path("a"));
    one.write(std::string(100, '1'));
    two.write(std::string(50, '2'));
    one.write(std::string(100, '1'));
    two.commit();
    EXPECT_EQ(read_text_file(path("a")), std::string(50, '2'));
    one.commit();
  }
  EXPECT_EQ(read_text_file(path("a")), std::string(200, '1'));
  EXPECT_EQ(read_text_file(path("a.tmp")), "somebody's own");
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder_), std::filesystem::directory_iterator()), 2);
}

TEST_F(BaseFiles, OneWriterHoldsTheLock) {
  {
    const WriterLock first(path("a"));
    const pid_t child = fork();
    if (child == 0) {
      int code = 1;
      try {
        const WriterLock second(path("a"));
      } catch (const IoError& error) {
        code = std::string(error.what()).find("another process") != std::string::npos ? 0 : 2;
      }
      _exit(code);
    }
    int status = -1;
    ASSERT_EQ(waitpid(child, &status, 0), child);
    EXPECT_EQ(WEXITSTATUS(status), 0);
  }
  const WriterLock again(path("a"));
  EXPECT_NO_THROW(WriterLock("/dev/null"));
}

TEST_F(BaseFiles, AtomicFileFollowsLinks) {
  write_text_file(path("target"), "old");
  std::filesystem::create_symlink(path("target"), path("link"));
  write_text_file(path("link"), "new");
  EXPECT_TRUE(std::filesystem::is_symlink(path("link")));
  EXPECT_EQ(read_text_file(path("target")), "new");
}

TEST_F(BaseFiles, AtomicFileNamesWhatIsWrong) {
  EXPECT_THROW(AtomicFile(path("none/x")), IoError);
  EXPECT_THROW(AtomicFile(folder_.string()), IoError);
  EXPECT_THROW(AtomicFile(""), IoError);
  EXPECT_THROW(read_text_file(path("none")), IoError);
  EXPECT_THROW(read_text_file(folder_.string()), IoError);
  write_text_file(path("file"), "");
  EXPECT_THROW(require_writable(path("file/x")), IoError);
  try {
    require_writable(path("none/x"));
  } catch (const IoError& error) {
    EXPECT_NE(std::string(error.what()).find("none does not exist"), std::string::npos) << error.what();
  }
}

TEST_F(BaseFiles, AtomicFileReportsAFullDisk) {
  // /dev/full takes nothing; it is written directly because it is no regular file.
  AtomicFile full("/dev/full");
  EXPECT_THROW(full.write(std::string("x")), IoError);
  // A size limit on a regular file: the old content must survive.
  write_text_file(path("a"), "old");
  signal(SIGXFSZ, SIG_IGN);
  rlimit before{};
  ASSERT_EQ(getrlimit(RLIMIT_FSIZE, &before), 0);
  rlimit limit = before;
  limit.rlim_cur = 100;
  ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &limit), 0);
  EXPECT_THROW(write_text_file(path("a"), std::string(1000, 'x')), IoError);
  setrlimit(RLIMIT_FSIZE, &before);
  EXPECT_EQ(read_text_file(path("a")), "old");
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder_), std::filesystem::directory_iterator()), 1);
}

TEST(Interrupt, FirstSignalSetsAFlag) {
  install_interrupt_handler();
  defer_interrupts();
  set_interrupted(0);
  EXPECT_FALSE(interrupted());
  raise(SIGTERM);
  EXPECT_TRUE(interrupted());
  EXPECT_EQ(interrupt_signal(), SIGTERM);
  set_interrupted(0);
}

// The exit code of a process that gets `count` signals and would end with 7 by itself.
int exit_code_after_signals(int count, bool defer) {
  const pid_t child = fork();
  if (child == 0) {
    const int null = open("/dev/null", O_WRONLY);
    dup2(null, STDERR_FILENO);
    install_interrupt_handler();
    if (defer) defer_interrupts();
    for (int i = 0; i < count; ++i) raise(SIGINT);
    _exit(7);
  }
  int status = 0;
  if (waitpid(child, &status, 0) != child || !WIFEXITED(status)) return -1;
  return WEXITSTATUS(status);
}

TEST(Interrupt, FirstSignalEndsWith130WhileThereIsNothingToSave) {
  EXPECT_EQ(exit_code_after_signals(1, false), 130);
  EXPECT_EQ(exit_code_after_signals(1, true), 7);
}

TEST(Interrupt, SecondSignalEndsWith130) { EXPECT_EQ(exit_code_after_signals(2, true), 130); }

TEST_F(BaseFiles, JsonLinesCanBeFollowedAndAppended) {
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
  EXPECT_THROW(JsonLines(path("none/log")), IoError);
}

TEST(Progress, EstimatesFromWhereItStarted) {
  set_log_level(LogLevel::normal);
  Progress progress("test");
  EXPECT_LT(progress.remaining(0.5), 0.0) << "nothing known before the first update";
  testing::internal::CaptureStderr();
  progress.update(0.5, "resumed");
  std::this_thread::sleep_for(std::chrono::milliseconds(40));
  const double left = progress.remaining(0.75);  // half of what was left took 40 ms
  EXPECT_GT(left, 0.02);
  EXPECT_LT(left, 2.0);
  progress.update(0.75, "forced", true);
  progress.finish();
  const std::string text = testing::internal::GetCapturedStderr();
  EXPECT_NE(text.find("test"), std::string::npos) << text;
  EXPECT_NE(text.find("forced"), std::string::npos) << text;
}

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

TEST(CpuInfo, IsFilledIn) {
  const CpuInfo info = cpu_info();
  EXPECT_GE(info.logical_cores, 1);
  EXPECT_FALSE(info.level.empty());
}

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
