// Progress of long work: one terminal line a few times a second, plain lines every ten seconds elsewhere.
#pragma once

#include <memory>
#include <mutex>
#include <string>

#include <nlohmann/json_fwd.hpp>

#include "octrad/base/stopwatch.h"

namespace octrad {

class Progress {
 public:
  // `label` begins every line. Nothing is shown below LogLevel::normal.
  explicit Progress(std::string label);
  ~Progress();

  // Whether it is time for the next line; cheap, so that callers can skip composing it.
  bool due() const;
  // Shows "label 12 %  ETA 3m 05s  text" (with the time so far where there are no 80 columns to keep to) if due (or
  // `force`). `fraction` done in [0, 1], negative if unknown. The ETA is `left`, seconds; where that is negative it is
  // extrapolated from the first update, so resumed work is estimated right. Thread-safe.
  void update(double fraction, const std::string& text, bool force = false, double left = -1.0);
  // Removes the terminal line.
  void finish();
  double seconds() const { return watch_.seconds(); }
  // Estimated seconds left; negative if unknown.
  double remaining(double fraction) const;

 private:
  std::string label_;
  Stopwatch watch_;
  mutable std::mutex mutex_;
  double interval_;
  double next_;
  double first_fraction_ = -1.0, first_seconds_ = 0.0;
};

// A file with one JSON object a line (--log-json), written at once so that it can be followed. Work must not be lost
// for its log: a line that cannot be written is dropped, with one warning; later lines are tried again. Thread-safe.
class JsonLines {
 public:
  // Appends to `file`, or empties it before the first line: what was there is lost only once there is something to
  // say. Throws IoError.
  explicit JsonLines(const std::string& file, bool append = false);
  ~JsonLines();
  void write(const nlohmann::json& object);
  // At the end of the work: throws IoError when lines are missing.
  void finish();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace octrad
