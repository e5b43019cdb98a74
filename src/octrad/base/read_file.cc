#include "octrad/base/read_file.h"

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

std::string read_file(const std::string& file) {
  const int descriptor = open(file.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK);  // opening a pipe must not wait
  const auto fail = [&](const char* reason) {
    const IoError error(fmt::format("cannot read {}: {}", file, reason));
    if (descriptor >= 0) close(descriptor);
    throw error;
  };
  if (descriptor < 0) fail(std::strerror(errno));
  struct stat info {};
  if (fstat(descriptor, &info) != 0) fail(std::strerror(errno));
  if (S_ISDIR(info.st_mode)) fail("it is a folder, not a file");
  if (!S_ISREG(info.st_mode)) fail("it is not a regular file");
  std::string text;
  try {
    ask_memory(static_cast<std::uint64_t>(info.st_size), file);
    text.resize(static_cast<std::size_t>(info.st_size));
  } catch (...) {
    close(descriptor);
    throw;
  }
  std::size_t done = 0;
  while (done < text.size()) {
    const ssize_t n = read(descriptor, text.data() + done, std::min<std::size_t>(text.size() - done, 1 << 30));
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) fail(std::strerror(errno));
    if (n == 0) break;  // it has become shorter
    done += static_cast<std::size_t>(n);
  }
  close(descriptor);
  text.resize(done);
  return text;
}

}  // namespace octrad
