// Messages for the user, on standard error. The one global of the program.
#pragma once

#include <fmt/core.h>

#include <string>
#include <utility>

namespace octrad {

enum class LogLevel { quiet = 0, normal = 1, verbose = 2 };

void set_log_level(LogLevel level);
LogLevel log_level();

// Writes one message (a newline is added) if `level` is at most the current one. Thread-safe; a status line that is on
// screen is moved below the message.
void log_message(LogLevel level, const std::string& message);
// Shown even with -q.
void log_error(const std::string& message);
void log_warning(const std::string& message);

template <typename... Args>
void log_info(fmt::format_string<Args...> format, Args&&... args) {
  if (log_level() >= LogLevel::normal) log_message(LogLevel::normal, fmt::format(format, std::forward<Args>(args)...));
}
template <typename... Args>
void log_verbose(fmt::format_string<Args...> format, Args&&... args) {
  if (log_level() >= LogLevel::verbose)
    log_message(LogLevel::verbose, fmt::format(format, std::forward<Args>(args)...));
}

// Whether standard error is a terminal that can redraw a line.
bool log_is_terminal();
// Replaces the one line at the bottom of a terminal (cut to its width, between fields where two blanks separate them);
// "" removes it. No-op when not a terminal.
void log_status_line(const std::string& text);

}  // namespace octrad
