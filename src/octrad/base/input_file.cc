#include "octrad/base/input_file.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

#include "octrad/base/error.h"
#include "octrad/base/memory_limit.h"

namespace octrad {
namespace {

[[noreturn]] void fail(const std::string& file, int error) {
  throw IoError(fmt::format("cannot read {}: {}", file, std::strerror(error)));
}

}  // namespace

InputFile::InputFile(const std::string& file) : name_(file) {
  descriptor_ = open(file.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK | O_NOCTTY);  // a pipe must not be waited for
  if (descriptor_ < 0) fail(file, errno);
  struct stat info {};
  const int error = fstat(descriptor_, &info) == 0 ? 0 : errno;
  if (error != 0 || !S_ISREG(info.st_mode)) {
    close(descriptor_);
    if (error != 0) fail(file, error);
    throw IoError(fmt::format("cannot read {}: it is {}, not a file", file,
                              S_ISDIR(info.st_mode)    ? "a folder"
                              : S_ISFIFO(info.st_mode) ? "a pipe"
                                                       : "a device"));
  }
  size_ = static_cast<std::uint64_t>(info.st_size);
  modified_ = info.st_mtim;
}

InputFile::~InputFile() { close(descriptor_); }

void InputFile::read(void* to, std::size_t bytes, std::uint64_t offset) const {
  char* out = static_cast<char*>(to);
  while (bytes > 0) {
    const ssize_t n =
        pread(descriptor_, out, std::min<std::size_t>(bytes, std::size_t{1} << 30), static_cast<off_t>(offset));
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) fail(name_, errno);
    if (n == 0) throw IoError(fmt::format("cannot read {}: it became shorter while it was read", name_));
    out += n;
    offset += static_cast<std::uint64_t>(n);
    bytes -= static_cast<std::size_t>(n);
  }
}

void InputFile::require_unchanged() const {
  struct stat now {};
  if (fstat(descriptor_, &now) != 0) fail(name_, errno);
  if (static_cast<std::uint64_t>(now.st_size) != size_ || now.st_mtim.tv_sec != modified_.tv_sec ||
      now.st_mtim.tv_nsec != modified_.tv_nsec)
    throw IoError(fmt::format("cannot read {}: it was written while it was read", name_));
}

std::string read_file(const std::string& file) {
  const InputFile in(file);
  ask_memory(in.size(), file);
  std::string text(static_cast<std::size_t>(in.size()), '\0');
  in.read(text.data(), text.size(), 0);
  return text;
}

}  // namespace octrad
