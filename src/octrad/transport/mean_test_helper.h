// For tests of transport: means of estimates.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "octrad/base/vec.h"

namespace octrad::testing {

struct Mean {
  double value = 0.0, error = 0.0;  // standard error
};

// Of the red channel.
inline Mean mean(const std::vector<Vec3f>& values) {
  const auto n = static_cast<double>(values.size());
  double sum = 0.0, squares = 0.0;
  for (const Vec3f& v : values) {
    sum += static_cast<double>(v.x);
    squares += static_cast<double>(v.x) * static_cast<double>(v.x);
  }
  return {sum / n, std::sqrt(std::max(0.0, squares / n - sum / n * sum / n) / n)};
}

}  // namespace octrad::testing
