// Lists of words in messages, and those that may have been meant.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace octrad {

// "a, b, c", of any range of strings.
template <typename Words>
std::string join(const Words& words, std::string_view separator = ", ") {
  std::string result;
  for (const auto& word : words) {
    if (!result.empty()) result += separator;
    result += word;
  }
  return result;
}

// Keys of a map for did_you_mean(): all, or of many those around `word`, as each takes the time of a comparison and a
// file may hold many mistakes.
template <typename Map>
std::vector<std::string> keys_near(const Map& map, const std::string& word) {
  constexpr int kEachWay = 100;
  auto begin = map.lower_bound(word), end = begin;
  for (int i = 0; i < kEachWay && begin != map.begin(); ++i) --begin;
  for (int i = 0; i < kEachWay && end != map.end(); ++i) ++end;
  std::vector<std::string> keys;
  for (; begin != end; ++begin) keys.push_back(begin->first);
  return keys;
}

}  // namespace octrad
