#include "octrad/base/log.h"

#include <sys/ioctl.h>
#include <unistd.h>

#include <atomic>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <mutex>

#include "octrad/base/escape.h"

namespace octrad {
namespace {

struct Log {
  std::atomic<LogLevel> level{LogLevel::normal};
  std::mutex mutex;
  std::string status;
};
Log& the_log() {
  static Log log;
  return log;
}

std::size_t terminal_width() {
  winsize size{};
  return ioctl(STDERR_FILENO, TIOCGWINSZ, &size) == 0 && size.ws_col > 0 ? size.ws_col : 80;
}

void put(const std::string& text) {
  std::fwrite(text.data(), 1, text.size(), stderr);
  std::fflush(stderr);
}

void print_line(const std::string& text) {
  const std::string message = printable(text);
  Log& log = the_log();
  const std::lock_guard lock(log.mutex);
  // One write for the whole line, so that lines of several processes do not mix.
  if (log.status.empty()) put(message + "\n");
  else put("\r\x1b[K" + message + "\n" + log.status);
}

}  // namespace

void set_log_level(LogLevel level) { the_log().level = level; }
LogLevel log_level() { return the_log().level; }

void log_message(LogLevel level, const std::string& message) {
  if (log_level() >= level) print_line(message);
}

void log_error(const std::string& message) { print_line("octrad: error: " + message); }
void log_warning(const std::string& message) { print_line("octrad: warning: " + message); }

bool log_is_terminal() {
  static const bool terminal = [] {
    const char* term = std::getenv("TERM");
    return isatty(STDERR_FILENO) != 0 && !(term && std::strcmp(term, "dumb") == 0);
  }();
  return terminal;
}

void log_status_line(const std::string& text) {
  if (!log_is_terminal()) return;
  Log& log = the_log();
  const std::lock_guard lock(log.mutex);
  if (text.empty() && log.status.empty()) return;
  const std::size_t width = terminal_width();
  log.status = text;
  if (text.size() >= width) {  // whole fields, which two blanks separate
    const std::size_t end = text.rfind("  ", width - 1);
    log.status = text.substr(0, end == std::string::npos || end == 0 ? width - 1 : end);
  }
  put("\r" + log.status + "\x1b[K");
}

}  // namespace octrad
