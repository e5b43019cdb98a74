#include "device/stage_times.h"

#include <algorithm>
#include <numeric>

namespace octrad {

void StageTimes::begin() {
  events_.clear();
  events_.emplace_back("", stream_.record());
}

void StageTimes::mark(const char* stage) { events_.emplace_back(stage, stream_.record()); }

void StageTimes::settle() {
  for (std::size_t i = 1; i < events_.size(); ++i) {
    const auto known = std::find_if(times_.begin(), times_.end(), [&](const auto& entry) { return entry.first == events_[i].first; });
    auto& entry = known != times_.end() ? *known : times_.emplace_back(events_[i].first, std::vector<double>{});
    entry.second.push_back(stream_.milliseconds(*events_[i - 1].second, *events_[i].second));
  }
  events_.clear();
}

StageSplit StageTimes::medians() const {
  StageSplit split;
  for (const auto& [stage, times] : times_) split.emplace_back(stage, percentile(times, 0.5));
  return split;
}

StageSplit StageTimes::means() const {
  StageSplit split;
  for (const auto& [stage, times] : times_) split.emplace_back(stage, std::accumulate(times.begin(), times.end(), 0.0) / static_cast<double>(times.size()));
  return split;
}

double percentile(std::vector<double> values, double share) {
  std::sort(values.begin(), values.end());
  return values[std::min(values.size() - 1, static_cast<std::size_t>(share * static_cast<double>(values.size())))];
}

}  // namespace octrad
