// Lists of words in messages.
#pragma once

#include <string>
#include <vector>

namespace octrad {

// "a, b, c".
inline std::string join(const std::vector<std::string>& words, const std::string& separator = ", ") {
  std::string result;
  for (const std::string& word : words) result += (result.empty() ? "" : separator) + word;
  return result;
}

}  // namespace octrad
