// Rays and grids that checks and benchmarks share.
#pragma once

#include <cmath>
#include <vector>

#include "app/selftest/kernels.h"
#include "app/selftest/selftest.h"
#include "octrad/device/array.h"

namespace octrad::selftest {

inline Vec3f uniform_direction(Vec2f u) {
  const float z = 1.0f - 2.0f * u.x, r = std::sqrt(std::fmax(0.0f, 1.0f - z * z));
  return {r * std::cos(2.0f * kPi * u.y), r * std::sin(2.0f * kPi * u.y), z};
}

// Levels of a hash grid from 16 to 1024 cells, the coarse ones dense.
std::vector<HashGridLevelView> hash_grid_levels();

// The tree and incoherent rays in the stream's memory. `finite`: rays end somewhere within the scene's size.
class RayFixture {
 public:
  RayFixture(const Context& context, std::size_t n, bool finite = false);
  std::size_t size() const { return host_.size(); }
  const std::vector<RayQuery>& host() const { return host_; }
  const DeviceRay* data() const { return rays_.data(); }
  Bvh8View bvh() const;

 private:
  std::vector<RayQuery> host_;
  DeviceArray<DeviceRay> rays_;
  DeviceArray<Bvh8Node> nodes_;
  DeviceArray<Bvh8Primitive> primitives_;
};

}  // namespace octrad::selftest
