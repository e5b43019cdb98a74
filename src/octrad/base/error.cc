#include "octrad/base/error.h"

#include <algorithm>

#include "octrad/base/lower_case.h"

namespace octrad {
namespace {

// Edit distance with transpositions of adjacent letters (optimal string alignment).
int edit_distance(const std::string& a, const std::string& b) {
  const std::size_t n = a.size(), m = b.size();
  std::vector<std::vector<int>> d(n + 1, std::vector<int>(m + 1));
  for (std::size_t i = 0; i <= n; ++i) d[i][0] = static_cast<int>(i);
  for (std::size_t j = 0; j <= m; ++j) d[0][j] = static_cast<int>(j);
  for (std::size_t i = 1; i <= n; ++i) {
    for (std::size_t j = 1; j <= m; ++j) {
      d[i][j] = std::min({d[i - 1][j] + 1, d[i][j - 1] + 1, d[i - 1][j - 1] + (a[i - 1] == b[j - 1] ? 0 : 1)});
      if (i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1])
        d[i][j] = std::min(d[i][j], d[i - 2][j - 2] + 1);
    }
  }
  return d[n][m];
}

}  // namespace

std::string did_you_mean(const std::string& word, const std::vector<std::string>& candidates) {
  if (word.empty() || word.size() > 200) return "";
  const std::string w = lower_case(word);
  const std::string* best = nullptr;
  // At least one letter is right, so that a word of one letter is no other letter mistyped.
  int best_distance = std::min(std::max(1, static_cast<int>(w.size()) / 3) + 1, static_cast<int>(w.size()));
  for (const std::string& candidate : candidates) {
    const std::string c = lower_case(candidate);
    // Not closer than their lengths.
    const auto gap =
        static_cast<int>(std::min<std::size_t>(c.size() > w.size() ? c.size() - w.size() : w.size() - c.size(), 1000));
    int distance = gap < best_distance ? edit_distance(w, c) : gap;
    // "levels" for "octree.levels", "--thread" for "--threads": the end or the beginning of a longer name. A word that
    // is an end letter by letter is likelier than one that is mistyped.
    const std::size_t dot = c.rfind('.');
    if (dot != std::string::npos && c.compare(dot + 1, std::string::npos, w) == 0) distance = 0;
    if (w.size() >= 4 && c.compare(0, w.size(), w) == 0) distance = std::min(distance, 2);
    if (distance < best_distance) {
      best_distance = distance;
      best = &candidate;
    }
  }
  return best ? " (did you mean \"" + *best + "\"?)" : "";
}

}  // namespace octrad
