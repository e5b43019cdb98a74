// Drawing one of many by their shares with one random number: for host and device.
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "octrad/base/hd.h"

namespace octrad {

// Entry i of n.
struct CdfEntry {
  float sum = 0.0f;         // of the shares up to and including this one; of the last entry 1
  std::uint32_t first = 0;  // the first entry that numbers from i / n on may fall into (Chen & Asau 1974)
};

OCTRAD_HD inline float sum_before(const CdfEntry* cdf, int i) { return i > 0 ? cdf[i - 1].sum : 0.0f; }
OCTRAD_HD inline float share_of(const CdfEntry* cdf, int i) { return cdf[i].sum - sum_before(cdf, i); }

// The first of `count` > 0 entries whose sum is above u in [0, 1), the last one where none is.
OCTRAD_HD inline int pick_entry(const CdfEntry* cdf, int count, float u) {
  if (count <= 2) return count == 2 && u >= cdf[0].sum ? 1 : 0;
  const int slot = static_cast<int>(u * static_cast<float>(count));
  auto i = static_cast<int>(cdf[slot < count ? slot : count - 1].first);
  while (i + 1 < count && !(u < cdf[i].sum)) ++i;
  return i;
}

// Where in entry i, of a share above 0, the number falls that picked it: uniform in [0, 1) again.
OCTRAD_HD inline float rest_of(const CdfEntry* cdf, int i, float u) {
  const float rest = (u - sum_before(cdf, i)) / share_of(cdf, i);
  return rest < 0.99999994f ? rest : 0.99999994f;
}

// The table of entries whose weights have these sums, in order. Where nothing has a weight, the first one has all.
inline std::vector<CdfEntry> make_cdf(const std::vector<double>& sums) {
  std::vector<CdfEntry> cdf(sums.size());
  const double total = sums.empty() ? 0.0 : sums.back(), n = static_cast<double>(sums.size());
  for (std::size_t i = 0; i < cdf.size(); ++i) cdf[i].sum = total > 0.0 ? static_cast<float>(sums[i] / total) : 1.0f;
  std::uint32_t entry = 0;
  for (std::size_t i = 0; i < cdf.size(); ++i) {
    const double start = static_cast<double>(i) * (1.0 - 1e-6) / n;  // pick_entry() rounds
    while (entry + 1 < cdf.size() && static_cast<double>(cdf[entry].sum) <= start) ++entry;
    cdf[i].first = entry;
  }
  return cdf;
}

}  // namespace octrad
