// Commands of this same program, run as processes of their own: a crash ends one command, not the whole run.
#pragma once

#include <functional>
#include <string>
#include <vector>

namespace octrad::paper {

struct ChildResult {
  int exit_code = 0;    // 128 + signal where one ended it
  std::string out;      // standard output
  std::string message;  // its last error message, without "octrad: error: "; for a crash, which signal
  double seconds = 0.0;
  double peak_bytes = 0.0;  // resident
  bool ok() const { return exit_code == 0; }
};

// Runs `octrad WORDS...` in `folder`, without a terminal; standard error is added to the file `log`, as far as that can
// be written. `waiting` is called several times a second. An interrupt of this process is passed on to the command
// once, which saves what it has and ends; a command never outlives this process. Throws IoError when it cannot be
// started.
ChildResult run_octrad(const std::vector<std::string>& words, const std::string& folder, const std::string& log,
                       const std::function<void()>& waiting);

}  // namespace octrad::paper
