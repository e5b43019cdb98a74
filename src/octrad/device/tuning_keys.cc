#include "octrad/device/tuning_keys.h"

#include <algorithm>
#include <charconv>
#include <iterator>

#include "octrad/base/error.h"

namespace octrad {
namespace {

struct Entry {
  const char* name;
  int DeviceTuning::*number;  // null: a switch
  bool DeviceTuning::*flag;
  int low, high;
};

constexpr int kMost = 1 << 24;
constexpr Entry kEntries[] = {
    {"cast_warps", &DeviceTuning::cast_warps, nullptr, 1, kMost},
    {"cast_share", &DeviceTuning::cast_share, nullptr, 1, 4096},
    {"cast_refill", &DeviceTuning::cast_refill, nullptr, 1, 32},
    {"cast_dynamic", nullptr, &DeviceTuning::cast_dynamic, 0, 1},
    {"block", &DeviceTuning::block, nullptr, 0, 1024},
    {"lhs_rounds", &DeviceTuning::lhs_rounds, nullptr, -1, 255},
    {"points_ahead", &DeviceTuning::points_ahead, nullptr, 1, kMost},
    {"draw_ahead", nullptr, &DeviceTuning::draw_ahead, 0, 1},
    {"query_chunk", &DeviceTuning::query_chunk, nullptr, 32, kMost},
    {"train_chunk", &DeviceTuning::train_chunk, nullptr, 32, kMost},
    {"frame_samples", &DeviceTuning::frame_samples, nullptr, 32, kMost},
    {"pixel_tiles", nullptr, &DeviceTuning::pixel_tiles, 0, 1},
    {"direct_film", nullptr, &DeviceTuning::direct_film, 0, 1},
    {"half_moments", nullptr, &DeviceTuning::half_moments, 0, 1},
    {"scan_touched", nullptr, &DeviceTuning::scan_touched, 0, 1},
};

}  // namespace

std::vector<std::string> tuning_keys() {
  std::vector<std::string> names;
  for (const Entry& entry : kEntries) names.emplace_back(entry.name);
  return names;
}

bool operator==(const DeviceTuning& a, const DeviceTuning& b) {
  return std::ranges::all_of(kEntries, [&](const Entry& e) {
    return e.number != nullptr ? a.*e.number == b.*e.number : a.*e.flag == b.*e.flag;
  });
}

void set(DeviceTuning& tuning, const std::string& key, const std::string& value) {
  const auto* known = std::ranges::find_if(kEntries, [&](const Entry& e) { return key == e.name; });
  if (known == std::end(kEntries))
    throw UsageError("-D device." + key + ": there is no such key" + did_you_mean(key, tuning_keys()));
  const Entry& entry = *known;
  int number = 0;
  const char* end = value.data() + value.size();
  const auto parsed = std::from_chars(value.data(), end, number);
  const bool multiple = key != "block" || number % 32 == 0;
  if (parsed.ec != std::errc() || parsed.ptr != end || number < entry.low || number > entry.high || !multiple) {
    throw UsageError("-D device." + key + "=" + value + ": expected a whole number from " + std::to_string(entry.low) +
                     " to " + std::to_string(entry.high) + (key == "block" ? ", a multiple of 32" : ""));
  }
  if (entry.number != nullptr) tuning.*entry.number = number;
  else tuning.*entry.flag = number != 0;
}

}  // namespace octrad
