#include <fcntl.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/file.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <filesystem>
#include <thread>

#include "octrad/base/atomic_file.h"
#include "octrad/base/error.h"
#include "octrad/base/folder_test_helper.h"
#include "octrad/base/input_file.h"

namespace octrad {
namespace {

void write_text_file(const std::string& file, const std::string& text) {
  AtomicFile out(file);
  out.write(text);
  out.commit();
}

class AtomicFiles : public ::testing::Test {
 protected:
  TestFolder temporary_;
  const std::filesystem::path& folder_ = temporary_.path();
  std::string path(const std::string& name) const { return temporary_.file(name); }
};

TEST_F(AtomicFiles, AtomicFileReplacesOrLeaves) {
  write_text_file(path("a"), "old");
  {
    AtomicFile out(path("a"));
    out.write(std::string("half"));
  }  // no commit
  EXPECT_EQ(read_file(path("a")), "old");
  write_text_file(path("a"), "new");
  EXPECT_EQ(read_file(path("a")), "new");
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder_), std::filesystem::directory_iterator()), 1);
}

TEST_F(AtomicFiles, AtomicFilesOfTwoWritersNeverMix) {
  write_text_file(path("a.tmp"), "somebody's own");
  {
    AtomicFile one(path("a")), two(path("a"));
    one.write(std::string(100, '1'));
    two.write(std::string(50, '2'));
    one.write(std::string(100, '1'));
    two.commit();
    EXPECT_EQ(read_file(path("a")), std::string(50, '2'));
    one.commit();
  }
  EXPECT_EQ(read_file(path("a")), std::string(200, '1'));
  EXPECT_EQ(read_file(path("a.tmp")), "somebody's own");
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder_), std::filesystem::directory_iterator()), 2);
}

TEST_F(AtomicFiles, OneWriterHoldsTheLock) {
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
      if (WriterLock::try_to_take(path("a"))) code = 3;
      if (!WriterLock::try_to_take(path("b"))) code = 4;
      _exit(code);
    }
    int status = -1;
    ASSERT_EQ(waitpid(child, &status, 0), child);
    EXPECT_EQ(WEXITSTATUS(status), 0);
  }
  const WriterLock again(path("a"));
  EXPECT_NO_THROW(WriterLock("/dev/null"));
}

TEST_F(AtomicFiles, AtomicFileFollowsLinks) {
  write_text_file(path("target"), "old");
  std::filesystem::create_symlink(path("target"), path("link"));
  write_text_file(path("link"), "new");
  EXPECT_TRUE(std::filesystem::is_symlink(path("link")));
  EXPECT_EQ(read_file(path("target")), "new");
}

TEST_F(AtomicFiles, LinksThatLeadNowhereAreMadeAndCirclesRefused) {
  std::filesystem::create_directory(path("folder"));
  std::filesystem::create_symlink("folder/second", path("first"));
  std::filesystem::create_symlink("target", path("folder/second"));
  write_text_file(path("first"), "new");
  EXPECT_TRUE(std::filesystem::is_symlink(path("first")));
  EXPECT_EQ(read_file(path("folder/target")), "new");
  std::filesystem::create_symlink("circle", path("circle"));
  EXPECT_THROW(require_writable(path("circle")), IoError);
  EXPECT_THROW(AtomicFile{path("circle")}, IoError);
  std::filesystem::create_symlink("none/target", path("astray"));
  EXPECT_THROW(require_writable(path("astray")), IoError);
}

TEST_F(AtomicFiles, NamesAreAsLongAsTheSystemTakes) {
  const std::string longest = path(std::string(255, 'n'));
  write_text_file(longest, "x");
  EXPECT_EQ(read_file(longest), "x");
  EXPECT_THROW(require_writable(path(std::string(256, 'n'))), IoError);
}

TEST_F(AtomicFiles, PermissionsAreThoseOfANewFile) {
  const mode_t before = umask(027);
  write_text_file(path("a"), "x");
  std::filesystem::permissions(path("a"), std::filesystem::perms::all);
  write_text_file(path("a"), "y");
  umask(before);
  EXPECT_EQ(std::filesystem::status(path("a")).permissions(), static_cast<std::filesystem::perms>(0640));
}

TEST_F(AtomicFiles, APipeThatNobodyReadsIsNotWaitedFor) {
  ASSERT_EQ(mkfifo(path("pipe").c_str(), 0600), 0);
  EXPECT_THROW(AtomicFile{path("pipe")}, IoError);
  const int reader = open(path("pipe").c_str(), O_RDONLY | O_NONBLOCK);
  write_text_file(path("pipe"), "text");
  char text[8] = {};
  EXPECT_EQ(read(reader, text, sizeof(text)), 4);
  close(reader);
}

// As the handler of a signal does that ends the process.
TEST_F(AtomicFiles, WhatHasANameIsRemovedAtTheEnd) {
  write_text_file(path("a"), "old");
  const pid_t child = fork();
  if (child == 0) {
    AtomicFile out(path("a"));
    out.write(std::string("half"));
    remove_temporary_files();
    _exit(0);
  }
  int status = -1;
  ASSERT_EQ(waitpid(child, &status, 0), child);
  EXPECT_EQ(read_file(path("a")), "old");
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder_), std::filesystem::directory_iterator()), 1);
}

// kill -9 leaves the file, and its owner may be another user.
TEST_F(AtomicFiles, ALockFileWithoutALockIsTaken) {
  write_text_file(path("a.lock"), "");
  std::filesystem::permissions(path("a.lock"), std::filesystem::perms::owner_read);
  EXPECT_TRUE(WriterLock::try_to_take(path("a")));
  EXPECT_FALSE(std::filesystem::exists(path("a.lock")));
}

// kill -9 between naming a new file and renaming it. Somebody who still writes has a lock on it.
TEST_F(AtomicFiles, WhatKilledWritersLeftIsRemoved) {
  const std::string left = path(".octrad-0123456789ab.tmp"), written = path(".octrad-ba9876543210.tmp");
  const std::string fresh = path(".octrad-0123456789cd.tmp");  // perhaps of another machine
  const auto long_ago = std::filesystem::file_time_type::clock::now() - std::chrono::hours(2);
  const std::string others[] = {path(".octrad-0123456789xy.tmp"), path(".octrad-mine.tmp"), path("0123456789ab.tmp")};
  write_text_file(left, "half");
  write_text_file(written, "half");
  write_text_file(fresh, "half");
  for (const std::string& old : {left, written}) std::filesystem::last_write_time(old, long_ago);
  for (const std::string& other : others) write_text_file(other, "somebody's own");
  write_text_file(path("target"), "somebody's own");
  std::filesystem::create_symlink("target", path(".octrad-000000000000.tmp"));
  std::filesystem::create_directory(path(".octrad-000000000001.tmp"));
  const int writer = open(written.c_str(), O_WRONLY | O_CLOEXEC);
  ASSERT_EQ(flock(writer, LOCK_EX), 0);
  { const WriterLock lock(path("a")); }
  EXPECT_FALSE(std::filesystem::exists(left));
  EXPECT_TRUE(std::filesystem::exists(fresh));
  EXPECT_TRUE(std::filesystem::exists(written));
  for (const std::string& other : others) EXPECT_TRUE(std::filesystem::exists(other)) << other;
  EXPECT_TRUE(std::filesystem::exists(path("target")));
  EXPECT_TRUE(std::filesystem::is_symlink(path(".octrad-000000000000.tmp")));
  EXPECT_TRUE(std::filesystem::is_directory(path(".octrad-000000000001.tmp")));
  close(writer);
  { const WriterLock lock(path("a")); }
  EXPECT_FALSE(std::filesystem::exists(written));
}

// Nobody's saving fails because another process removes what killed writers left.
TEST_F(AtomicFiles, WritersAndRemoversDoNotMeet) {
  std::atomic<bool> done{false};
  std::thread remover([&] {
    while (!done) WriterLock::try_to_take(path("a"));
  });
  for (int i = 0; i < 300; ++i) EXPECT_NO_THROW(write_text_file(path("b"), std::to_string(i)));
  done = true;
  remover.join();
  EXPECT_EQ(read_file(path("b")), "299");
}

TEST_F(AtomicFiles, WhereNoLockCanBeThereIsAWarning) {
  testing::internal::CaptureStderr();
  { const WriterLock lock(path(std::string(252, 'n'))); }
  EXPECT_NE(testing::internal::GetCapturedStderr().find("nothing keeps another process"), std::string::npos);
}

TEST_F(AtomicFiles, AtomicFileNamesWhatIsWrong) {
  EXPECT_THROW(AtomicFile(path("none/x")), IoError);
  EXPECT_THROW(AtomicFile(folder_.string()), IoError);
  EXPECT_THROW(AtomicFile(""), IoError);
  EXPECT_THROW(read_file(path("none")), IoError);
  EXPECT_THROW(read_file(folder_.string()), IoError);
  write_text_file(path("file"), "");
  EXPECT_THROW(require_writable(path("file/x")), IoError);
  try {
    require_writable(path("none/x"));
  } catch (const IoError& error) {
    EXPECT_NE(std::string(error.what()).find("none does not exist"), std::string::npos) << error.what();
  }
}

TEST_F(AtomicFiles, AtomicFileReportsAFullDisk) {
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
  EXPECT_EQ(read_file(path("a")), "old");
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder_), std::filesystem::directory_iterator()), 1);
}

}  // namespace
}  // namespace octrad
