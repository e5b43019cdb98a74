#include "octrad/base/progress.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <nlohmann/json.hpp>
#include <string_view>
#include <utility>

#include "octrad/base/duration.h"
#include "octrad/base/error.h"
#include "octrad/base/json_file.h"
#include "octrad/base/log.h"

namespace octrad {
namespace {
constexpr double kTerminalInterval = 0.25, kPlainInterval = 10.0;  // seconds
}

Progress::Progress(std::string label)
    : label_(std::move(label)),
      interval_(log_is_terminal() ? kTerminalInterval : kPlainInterval),
      next_(log_is_terminal() ? 0.0 : 2.0) {}

Progress::~Progress() { finish(); }

bool Progress::due() const {
  if (log_level() < LogLevel::normal) return false;
  const std::lock_guard lock(mutex_);
  return watch_.seconds() >= next_;
}

double Progress::remaining(double fraction) const {
  const double done = fraction - first_fraction_;
  if (fraction < 0.0 || first_fraction_ < 0.0 || done <= 0.0) return -1.0;
  return (watch_.seconds() - first_seconds_) * (1.0 - fraction) / done;
}

void Progress::update(double fraction, const std::string& text, bool force, double left) {
  if (log_level() < LogLevel::normal) return;
  std::string line;
  {
    const std::lock_guard lock(mutex_);
    const double now = watch_.seconds();
    if (first_fraction_ < 0.0 && fraction >= 0.0) {
      first_fraction_ = fraction;
      first_seconds_ = now;
    }
    if (!force && now < next_) return;
    next_ = now + interval_;
    line = label_;
    if (fraction >= 0.0) line += fmt::format(" {:3.0f} %", 100.0 * fraction);
    if (left < 0.0) left = remaining(fraction);
    if (left >= 0.0) line += "  ETA " + format_duration(left);  // first: what does not fit is cut at the end
    line += "  " + text;
    if (left < 0.0 || !log_is_terminal()) line += "  " + format_duration(now);
  }
  if (log_is_terminal()) log_status_line(line);
  else log_message(LogLevel::normal, line);
}

void Progress::finish() { log_status_line(""); }

namespace {

struct LastLine {
  off_t begin = -1;     // of what stands after the last line end; -1 where it cannot be told
  bool object = false;  // it begins like a line of a log
};

LastLine last_line(const std::string& file, off_t size) {
  LastLine line;
  const int descriptor = open(file.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK | O_NOCTTY);
  if (descriptor < 0) return line;
  char block[4096];
  for (off_t end = size, begin = size; end > 0 && line.begin < 0; end = begin) {
    begin = std::max<off_t>(0, end - static_cast<off_t>(sizeof block));
    const ssize_t n = pread(descriptor, block, static_cast<std::size_t>(end - begin), begin);
    if (n != end - begin) break;
    const std::size_t last = std::string_view(block, static_cast<std::size_t>(n)).rfind('\n');
    if (last != std::string_view::npos) line.begin = begin + static_cast<off_t>(last) + 1;
    else if (begin == 0) line.begin = 0;
  }
  line.object = line.begin >= 0 && pread(descriptor, block, 1, line.begin) == 1 && block[0] == '{';
  close(descriptor);
  return line;
}

}  // namespace

struct JsonLines::Impl {
  std::string file;
  int descriptor = -1;
  off_t end = -1;         // of its last whole line; -1: a pipe or device
  bool empties = false;   // before its first line
  bool whole = true;      // it ends with a whole line
  long long dropped = 0;  // lines
  int error = 0;          // of the last of them
  std::mutex mutex;

  // Returns false, with errno, when not all could be written.
  bool put(std::string_view text) {
    while (!text.empty()) {
      const ssize_t n = ::write(descriptor, text.data(), text.size());
      if (n < 0 && errno == EINTR) continue;
      if (n < 0) return false;
      whole = false;
      text.remove_prefix(static_cast<std::size_t>(n));
    }
    return true;
  }
};

JsonLines::JsonLines(const std::string& file, bool append) : impl_(std::make_unique<Impl>()) {
  impl_->file = file;
  // Non-blocking only while it is opened: a pipe that nobody reads is an error.
  impl_->descriptor = open(file.c_str(), O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC | O_NONBLOCK | O_NOCTTY, 0666);
  if (impl_->descriptor < 0)
    throw IoError(fmt::format("cannot write {}: {}", file,
                              errno == ENXIO ? "it is a pipe that nobody reads" : std::strerror(errno)));
  fcntl(impl_->descriptor, F_SETFL, fcntl(impl_->descriptor, F_GETFL) & ~O_NONBLOCK);
  impl_->end = lseek(impl_->descriptor, 0, SEEK_END);
  impl_->empties = !append;
  if (!append || impl_->end <= 0) return;
  // A line that broke off, with the machine or the process, is cut away; anything else stays, as a line of its own.
  const LastLine last = last_line(file, impl_->end);
  if (last.begin < 0 || last.begin == impl_->end) return;
  if (last.object && ftruncate(impl_->descriptor, last.begin) == 0) impl_->end = last.begin;
  else impl_->whole = false;
}

JsonLines::~JsonLines() {
  if (impl_->descriptor >= 0) close(impl_->descriptor);
}

void JsonLines::write(const nlohmann::json& object) {
  const std::string line = json_text(object) + "\n";
  const std::lock_guard lock(impl_->mutex);
  if (std::exchange(impl_->empties, false) && ftruncate(impl_->descriptor, 0) == 0) impl_->end = 0;
  // In a pipe, what there is of a line that broke off ends with a line end; in a file it is cut off.
  if ((impl_->whole || impl_->put("\n")) && impl_->put(line)) {
    impl_->whole = true;
    impl_->end = lseek(impl_->descriptor, 0, SEEK_CUR);
    return;
  }
  impl_->error = errno;
  if (impl_->end >= 0 && ftruncate(impl_->descriptor, impl_->end) == 0) impl_->whole = true;
  if (impl_->dropped++ == 0)
    log_warning(fmt::format("cannot write {}: {}; the work goes on", impl_->file, std::strerror(impl_->error)));
}

void JsonLines::finish() {
  const std::lock_guard lock(impl_->mutex);
  if (impl_->descriptor >= 0 && close(std::exchange(impl_->descriptor, -1)) != 0 && impl_->dropped++ == 0)
    impl_->error = errno;
  if (impl_->dropped > 0)
    throw IoError(fmt::format("cannot write {}: {}; {} of its lines are missing, everything else is saved", impl_->file,
                              std::strerror(impl_->error), impl_->dropped));
}

}  // namespace octrad
