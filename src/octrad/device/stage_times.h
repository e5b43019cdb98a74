// How long the stages of a piece of work take on a stream, by the stream's own clock: begin(), then a mark after the
// launches of each stage (several of the same name add up). Nothing inside a recorded graph can be marked.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "octrad/device/stream.h"

namespace octrad {

// Called between the stages of a piece of work with the name of the one that ended.
using StageMark = std::function<void(const char*)>;
inline void no_mark(const char*) {}

// Milliseconds by stage, in the order in which stages first came.
using StageSplit = std::vector<std::pair<std::string, double>>;

class StageTimes {
 public:
  explicit StageTimes(Stream& stream) : stream_(stream) {}
  void begin();
  // `share`: the part of the time that counts, where the stage's work is for several pieces.
  void mark(const char* stage, double share = 1.0);
  // Waits for the marks since begin(), if any, and keeps the times between them.
  void settle();
  void forget() { marks_.clear(); }  // instead of settle()

  StageSplit medians() const;
  StageSplit means() const;

 private:
  Stream& stream_;
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
