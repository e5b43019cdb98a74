// Rays and grids that checks and benchmarks share.
#pragma once

#include <vector>

#include "app/selftest/kernels.h"
#include "app/selftest/selftest.h"
#include "octrad/device/array.h"

namespace octrad::selftest {

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
