#include "octrad/base/progress.h"

#include <fmt/format.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <nlohmann/json.hpp>

#include "octrad/base/duration.h"
#include "octrad/base/error.h"
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

void Progress::update(double fraction, const std::string& text, bool force) {
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
    const double left = remaining(fraction);
    if (left >= 0.0) line += "  ETA " + format_duration(left);  // first: what does not fit is cut at the end
    line += "  " + text;
    if (left < 0.0 || !log_is_terminal()) line += "  " + format_duration(now);
  }
  if (log_is_terminal()) log_status_line(line);
  else log_message(LogLevel::normal, line);
}

void Progress::finish() { log_status_line(""); }

struct JsonLines::Impl {
  std::string file;
  std::FILE* out = nullptr;
  std::mutex mutex;
};

JsonLines::JsonLines(const std::string& file, bool append) : impl_(std::make_unique<Impl>()) {
  impl_->file = file;
  impl_->out = std::fopen(file.c_str(), append ? "ab" : "wb");
  if (!impl_->out) throw IoError(fmt::format("cannot write {}: {}", file, std::strerror(errno)));
}

JsonLines::~JsonLines() { std::fclose(impl_->out); }

void JsonLines::write(const nlohmann::json& object) {
  const std::string line = object.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace) + "\n";
  const std::lock_guard lock(impl_->mutex);
  if (std::fwrite(line.data(), 1, line.size(), impl_->out) != line.size() || std::fflush(impl_->out) != 0) {
    throw IoError(fmt::format("cannot write {}: {}", impl_->file, std::strerror(errno)));
  }
}

}  // namespace octrad
