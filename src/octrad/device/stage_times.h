// How long the stages of a piece of work take on a stream, by the stream's own clock: from begin() to end() the marks
// that drivers set (Stream::mark) are timed, several of the same name together. Nothing inside a recorded graph can be
// marked.
#pragma once

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "octrad/device/stream.h"

namespace octrad {

// Milliseconds by stage, in the order in which stages first came.
using StageSplit = std::vector<std::pair<std::string, double>>;

class StageTimes {
 public:
  explicit StageTimes(Stream& stream) : stream_(stream) {}
  ~StageTimes() { end(); }
  StageTimes(const StageTimes&) = delete;
  StageTimes& operator=(const StageTimes&) = delete;
  void begin();
  // The part of the time that counts from now on, where the stages' work is for several pieces.
  void set_share(double share) { share_ = share; }
  void end();
  // Waits for the marks since begin(), if any, and keeps the times between them.
  void settle();
  void forget() { marks_.clear(); }  // instead of settle()

  StageSplit medians() const;
  StageSplit means() const;

 private:
  Stream& stream_;
  bool listening_ = false;
  double share_ = 1.0;
  struct Mark {
    std::string stage;
    double share = 0.0;
    std::unique_ptr<StreamEvent> event;
  };
  std::vector<Mark> marks_;
  std::vector<std::pair<std::string, std::vector<double>>> times_;
};

// The value that a share of the values is below; values must not be empty.
double percentile(std::vector<double> values, double share);

}  // namespace octrad
