// Tables that cdf_math.h draws from.
#pragma once

#include <span>
#include <vector>

#include "octrad/base/cdf_math.h"

namespace octrad {

// The table of entries whose weights have these sums, up to and including each. Where nothing has a weight, the first
// one has all.
std::vector<CdfEntry> make_cdf(std::span<const double> sums);

}  // namespace octrad
