#include "octrad/device/stage_times.h"

#include <algorithm>
#include <numeric>

namespace octrad {
namespace {

// What is kept under a name; new names come last.
template <typename T>
T& entry(std::vector<std::pair<std::string, T>>& list, const std::string& name) {
  const auto known = std::find_if(list.begin(), list.end(), [&](const auto& e) { return e.first == name; });
  return known != list.end() ? known->second : list.emplace_back(name, T{}).second;
}

}  // namespace

void StageTimes::begin() {
  marks_.clear();
  marks_.push_back({"", 0.0, stream_.record()});
  share_ = 1.0;
  listening_ = true;
  stream_.listen([this](const char* stage) { marks_.push_back({stage, share_, stream_.record()}); });
}

void StageTimes::end() {
  if (listening_) stream_.listen(nullptr);
  listening_ = false;
}

void StageTimes::settle() {
  StageSplit sums;
  for (std::size_t i = 1; i < marks_.size(); ++i) {
    entry(sums, marks_[i].stage) += marks_[i].share * stream_.milliseconds(*marks_[i - 1].event, *marks_[i].event);
  }
  for (const auto& [stage, ms] : sums) entry(times_, stage).push_back(ms);
  marks_.clear();
}

StageSplit StageTimes::medians() const {
  StageSplit split;
  for (const auto& [stage, times] : times_) split.emplace_back(stage, percentile(times, 0.5));
  return split;
}

StageSplit StageTimes::means() const {
  StageSplit split;
  for (const auto& [stage, times] : times_)
    split.emplace_back(stage, std::accumulate(times.begin(), times.end(), 0.0) / static_cast<double>(times.size()));
  return split;
}

double percentile(std::vector<double> values, double share) {
  std::sort(values.begin(), values.end());
  return values[std::min(values.size() - 1, static_cast<std::size_t>(share * static_cast<double>(values.size())))];
}

}  // namespace octrad
