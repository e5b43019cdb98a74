// Errors that a user can cause. The program maps each class to an exit code (see exit_code).
#pragma once

#include <stdexcept>
#include <string>
#include <vector>

namespace octrad {

enum class ExitCode { ok = 0, usage = 1, bad_input = 2, io = 3, out_of_memory = 4, device = 5, interrupted = 130 };

class Error : public std::runtime_error {
 public:
  Error(ExitCode code, const std::string& message) : std::runtime_error(message), code_(code) {}
  ExitCode code() const { return code_; }

 private:
  ExitCode code_;
};

// Wrong command line or option value.
struct UsageError : Error {
  explicit UsageError(const std::string& message) : Error(ExitCode::usage, message) {}
};
// A scene, configuration, model or image that cannot be used. Say what is wrong, where, and what would be accepted.
struct InputError : Error {
  explicit InputError(const std::string& message) : Error(ExitCode::bad_input, message) {}
};
// A file that cannot be opened, read or written.
struct IoError : Error {
  explicit IoError(const std::string& message) : Error(ExitCode::io, message) {}
};
// A request above the memory budget, or a failed allocation.
struct MemoryError : Error {
  explicit MemoryError(const std::string& message) : Error(ExitCode::out_of_memory, message) {}
};
// A GPU that cannot be used: no driver, too old a driver, lost while in use.
struct DeviceError : Error {
  explicit DeviceError(const std::string& message) : Error(ExitCode::device, message) {}
};

// " (did you mean \"x\"?)" for the candidate closest to `word` by edit distance, or "" when none is close.
std::string did_you_mean(const std::string& word, const std::vector<std::string>& candidates);

}  // namespace octrad
