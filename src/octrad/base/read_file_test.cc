#include "octrad/base/read_file.h"

#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>

#include "octrad/base/error.h"
#include "octrad/base/memory_limit.h"

namespace octrad {
namespace {

namespace fs = std::filesystem;

class ReadFile : public ::testing::Test {
 protected:
  void SetUp() override { fs::create_directories(folder_); }
  void TearDown() override { fs::remove_all(folder_); }
  std::string path(const std::string& name) const { return (folder_ / name).string(); }
  fs::path folder_ = fs::temp_directory_path() / ("octrad_read_file_" + std::to_string(::getpid()));
};

std::string refusal(const std::string& file) {
  try {
    read_file(file);
  } catch (const IoError& error) {
    return error.what();
  }
  return "";
}

TEST_F(ReadFile, EveryByte) {
  const std::string text("a\0\r\n\xff", 5);
  std::ofstream(path("a"), std::ios::binary) << text;
  EXPECT_EQ(read_file(path("a")), text);
  fs::create_symlink("a", path("link"));
  EXPECT_EQ(read_file(path("link")), text);
  std::ofstream(path("empty"), std::ios::binary).flush();
  EXPECT_EQ(read_file(path("empty")), "");
}

TEST_F(ReadFile, RefusesWhatIsNoFile) {
  EXPECT_NE(refusal(path("none")).find("No such file"), std::string::npos);
  EXPECT_NE(refusal(folder_.string()).find("is a folder"), std::string::npos);
  EXPECT_NE(refusal("/dev/zero").find("not a regular file"), std::string::npos) << "it has no end";
  ASSERT_EQ(mkfifo(path("pipe").c_str(), 0600), 0);
  EXPECT_NE(refusal(path("pipe")).find("not a regular file"), std::string::npos) << "nobody writes to it";
}

TEST_F(ReadFile, MemoryIsAskedFirst) {
  std::ofstream(path("large"), std::ios::binary).flush();
  fs::resize_file(path("large"), std::uintmax_t{1} << 40);  // a hole
  set_memory_limit(std::uint64_t{1} << 32);
  EXPECT_THROW(read_file(path("large")), MemoryError);
  set_memory_limit(0);
}

}  // namespace
}  // namespace octrad
