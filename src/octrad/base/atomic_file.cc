#include "octrad/base/atomic_file.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>

#include "octrad/base/error.h"

namespace octrad {
namespace {

[[noreturn]] void fail(const char* what, const std::string& file, int error) {
  throw IoError(fmt::format("cannot {} {}: {}", what, file, std::strerror(error)));
}

std::string folder_of(const std::string& file) {
  const std::string folder = std::filesystem::path(file).parent_path().string();
  return folder.empty() ? "." : folder;
}

// Follows a symbolic link, so that the rename replaces what it points to and not the link.
std::string resolve(const std::string& file) {
  std::error_code error;
  if (!std::filesystem::is_symlink(file, error)) return file;
  const std::filesystem::path target = std::filesystem::canonical(file, error);
  return error ? file : target.string();
}

}  // namespace

AtomicFile::AtomicFile(const std::string& file) : file_(resolve(file)) {
  require_writable(file_);
  struct stat info {};
  direct_ = stat(file_.c_str(), &info) == 0 && !S_ISREG(info.st_mode);
  temporary_ = direct_ ? file_ : file_ + ".tmp";
  descriptor_ =
      open(temporary_.c_str(), direct_ ? O_WRONLY | O_CLOEXEC : O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666);
  if (descriptor_ < 0) fail("write", file, errno);
}

AtomicFile::~AtomicFile() {
  if (descriptor_ >= 0) {
    close(descriptor_);
    if (!direct_) unlink(temporary_.c_str());
  }
}

void AtomicFile::write(const void* data, std::size_t bytes) {
  const char* p = static_cast<const char*>(data);
  while (bytes > 0) {
    const ssize_t n = ::write(descriptor_, p, std::min<std::size_t>(bytes, std::size_t{1} << 30));
    if (n < 0) {
      if (errno == EINTR) continue;
      fail("write", file_, errno);
    }
    p += n;
    bytes -= static_cast<std::size_t>(n);
  }
}

void AtomicFile::commit() {
  if (!direct_ && fsync(descriptor_) != 0) fail("write", file_, errno);
  const int descriptor = descriptor_;
  descriptor_ = -1;
  if (close(descriptor) != 0) {
    const int error = errno;
    if (!direct_) unlink(temporary_.c_str());
    fail("write", file_, error);
  }
  if (direct_) return;
  if (std::rename(temporary_.c_str(), file_.c_str()) != 0) {
    const int error = errno;
    unlink(temporary_.c_str());
    fail("replace", file_, error);
  }
  // The new name itself must survive a power failure too. Not every file system can sync a folder: best effort.
  const int folder = open(folder_of(file_).c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (folder >= 0) {
    fsync(folder);
    close(folder);
  }
}

void require_writable(const std::string& file) {
  if (file.empty()) throw IoError("cannot write: the file name is empty");
  struct stat info {};
  if (stat(file.c_str(), &info) == 0) {
    if (S_ISDIR(info.st_mode)) throw IoError(fmt::format("cannot write {}: it is a folder", file));
    if (access(file.c_str(), W_OK) != 0) fail("write", file, errno);
    if (!S_ISREG(info.st_mode)) return;
  }
  const std::string folder = folder_of(file);
  if (stat(folder.c_str(), &info) != 0)
    throw IoError(fmt::format("cannot write {}: folder {} does not exist", file, folder));
  if (!S_ISDIR(info.st_mode)) throw IoError(fmt::format("cannot write {}: {} is not a folder", file, folder));
  if (access(folder.c_str(), W_OK | X_OK) != 0) fail("write", file, errno);
}

std::string read_text_file(const std::string& file) {
  std::FILE* in = std::fopen(file.c_str(), "rb");
  if (!in) fail("read", file, errno);
  std::string text;
  char buffer[1 << 16];
  std::size_t n = 0;
  while ((n = std::fread(buffer, 1, sizeof(buffer), in)) > 0) text.append(buffer, n);
  const int error = std::ferror(in) ? errno : 0;
  std::fclose(in);
  if (error != 0) fail("read", file, error);
  return text;
}

void write_text_file(const std::string& file, const std::string& text) {
  AtomicFile out(file);
  out.write(text);
  out.commit();
}

}  // namespace octrad
