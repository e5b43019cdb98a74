#include "octrad/device/tuning_keys.h"

#include <algorithm>
#include <charconv>
#include <string_view>
#include <vector>

#include "octrad/base/error.h"

namespace octrad {
namespace {

struct Entry {
  int DeviceTuning::*number;  // null: a switch
  bool DeviceTuning::*flag;
  int low, high;
};

constexpr TuningKey kKeys[] = {
    {"cast_warps", "least number of warps that cast rays"},
    {"cast_share", "rays for each lane of a warp before there are more warps"},
    {"cast_refill", "lanes that are done before new rays are taken"},
    {"cast_dynamic", "warps take rays from what is left of all instead of a share"},
    {"chain_rounds", "rounds of rays for right-hand-side chains over mirrors and glass; 0: each by a thread alone"},
    {"block", "threads of a block, at most what kernels are compiled for; 0: that"},
    {"lhs_rounds", "rounds of rays for all left-hand-side points together; -1: by the configuration"},
    {"points_ahead", "left-hand-side points drawn at a time"},
    {"draw_ahead", "left-hand-side points drawn on another stream, beside the steps before"},
    {"query_chunk", "queries of a training step in flight"},
    {"train_chunk", "points whose activations are kept at a time"},
    {"frame_samples", "samples of a picture's job"},
    {"pixel_tiles", "pixels in tiles of 8 x 4 instead of rows"},
    {"direct_film", "a frame of one sample a pixel shown without the film's sums"},
    {"sort_queries", "queries of the field sorted by their place"},
    {"half_moments", "dense Adam's moments of tables in half the bytes, rounded by chance"},
    {"scan_touched", "touched table entries listed by a scan over their bits"},
};
constexpr int kMost = 1 << 24;
constexpr Entry kEntries[] = {
    {&DeviceTuning::cast_warps, nullptr, 1, kMost},   {&DeviceTuning::cast_share, nullptr, 1, 4096},
    {&DeviceTuning::cast_refill, nullptr, 1, 32},     {nullptr, &DeviceTuning::cast_dynamic, 0, 1},
    {&DeviceTuning::chain_rounds, nullptr, 0, 64},    {&DeviceTuning::block, nullptr, 0, 1024},
    {&DeviceTuning::lhs_rounds, nullptr, -1, 255},    {&DeviceTuning::points_ahead, nullptr, 1, kMost},
    {nullptr, &DeviceTuning::draw_ahead, 0, 1},       {&DeviceTuning::query_chunk, nullptr, 32, kMost},
    {&DeviceTuning::train_chunk, nullptr, 32, kMost}, {&DeviceTuning::frame_samples, nullptr, 32, kMost},
    {nullptr, &DeviceTuning::pixel_tiles, 0, 1},      {nullptr, &DeviceTuning::direct_film, 0, 1},
    {nullptr, &DeviceTuning::sort_queries, 0, 1},     {nullptr, &DeviceTuning::half_moments, 0, 1},
    {nullptr, &DeviceTuning::scan_touched, 0, 1},
};
static_assert(std::size(kKeys) == std::size(kEntries));

}  // namespace

std::span<const TuningKey> tuning_keys() { return kKeys; }

bool operator==(const DeviceTuning& a, const DeviceTuning& b) {
  return std::ranges::all_of(kEntries, [&](const Entry& e) {
    return e.number != nullptr ? a.*e.number == b.*e.number : a.*e.flag == b.*e.flag;
  });
}

void set(DeviceTuning& tuning, const std::string& key, const std::string& value) {
  const auto* known =
      std::find_if(std::begin(kKeys), std::end(kKeys), [&](const TuningKey& k) { return key == k.name; });
  if (known == std::end(kKeys)) {
    std::vector<std::string> names;
    for (const TuningKey& k : kKeys) names.emplace_back(k.name);
    throw UsageError("-D device." + key + ": there is no such key" + did_you_mean(key, names));
  }
  const Entry& entry = kEntries[known - kKeys];
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
