#include "octrad/shading/place_grid.h"

#include <algorithm>
#include <vector>

namespace octrad {

Bounds3f bounds_of_most(std::span<const Vec3f> positions) {
  constexpr double kLeftOut = 0.02;  // at each end of an axis
  Bounds3f box;
  for (int a = 0; a < 3; ++a) {
    std::vector<float> along;
    for (const Vec3f& p : positions) along.push_back(p[a]);
    std::sort(along.begin(), along.end());
    const auto skipped = static_cast<std::size_t>(kLeftOut * static_cast<double>(along.size()));
    box.lower[a] = along[skipped];
    box.upper[a] = along[along.size() - 1 - skipped];
  }
  return box;
}

}  // namespace octrad
