#include "octrad/base/cdf.h"

namespace octrad {

std::vector<CdfEntry> make_cdf(std::span<const double> sums) {
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
