// What estimators count, on the host and in a device's memory.
#pragma once

namespace octrad {

struct TraceCounts {
  unsigned long long rays = 0, queries = 0;
  unsigned long long non_finite = 0;  // contributions dropped
  TraceCounts& operator+=(const TraceCounts& b) {
    rays += b.rays;
    queries += b.queries;
    non_finite += b.non_finite;
    return *this;
  }
};

}  // namespace octrad
