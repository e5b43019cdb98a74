// Drawing one of many by their shares with one random number, from a table of make_cdf() (base/cdf.h): for host and
// device.
#pragma once

#include <cstdint>

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

}  // namespace octrad
