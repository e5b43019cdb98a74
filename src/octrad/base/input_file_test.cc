#include "octrad/base/input_file.h"

#include <gtest/gtest.h>
#include <sys/stat.h>

#include <filesystem>
#include <fstream>

#include "octrad/base/error.h"
#include "octrad/base/folder_test_helper.h"
#include "octrad/base/memory_limit.h"

namespace octrad {
namespace {

class InputFiles : public ::testing::Test {
 protected:
  std::string message(const std::string& file) const {
    try {
      InputFile{file};
    } catch (const IoError& error) {
      return error.what();
    }
    return "";
  }
  TestFolder folder_;
};

TEST_F(InputFiles, ReadsAnyPart) {
  const std::string file = folder_.file("a");
  std::ofstream(file) << "0123456789";
  const InputFile in(file);
  EXPECT_EQ(in.size(), 10u);
  char part[3];
  in.read(part, 3, 4);
  EXPECT_EQ(std::string(part, 3), "456");
  EXPECT_NO_THROW(in.require_unchanged());
}

// Neither waits nor ends.
TEST_F(InputFiles, PipesAndDevicesAreRefused) {
  const std::string pipe = folder_.file("pipe");
  ASSERT_EQ(mkfifo(pipe.c_str(), 0600), 0);
  EXPECT_EQ(message(pipe), "cannot read " + pipe + ": it is a pipe, not a file");
  EXPECT_EQ(message("/dev/zero"), "cannot read /dev/zero: it is a device, not a file");
  EXPECT_NE(message(folder_.file("")).find("it is a folder"), std::string::npos);
  EXPECT_NE(message(folder_.file("none")).find("No such file"), std::string::npos);
}

TEST_F(InputFiles, AFileThatChangesIsAnError) {
  const std::string file = folder_.file("a");
  std::ofstream(file) << std::string(1000, 'x');
  const InputFile in(file);
  std::filesystem::resize_file(file, 500);
  std::string text(1000, ' ');
  EXPECT_NO_THROW(in.read(text.data(), 500, 0));
  EXPECT_THROW(in.read(text.data(), 1000, 0), IoError);
  EXPECT_THROW(in.require_unchanged(), IoError);
}

TEST_F(InputFiles, AWholeFileHasEveryByte) {
  const std::string text("a\0\r\n\xff", 5);
  const std::string file = folder_.write("a", text);
  EXPECT_EQ(read_file(file), text);
  std::filesystem::create_symlink("a", folder_.file("link"));
  EXPECT_EQ(read_file(folder_.file("link")), text);
  EXPECT_EQ(read_file(folder_.write("empty", "")), "");
  EXPECT_THROW(read_file("/dev/zero"), IoError);
}

TEST_F(InputFiles, AWholeFileIsReadIfThereIsMemory) {
  const std::string file = folder_.write("large", "");
  std::filesystem::resize_file(file, std::uintmax_t{1} << 40);  // a hole
  set_memory_limit(std::uint64_t{1} << 32);
  EXPECT_THROW(read_file(file), MemoryError);
  set_memory_limit(0);
}

}  // namespace
}  // namespace octrad
