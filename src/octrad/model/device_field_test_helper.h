// Points in device memory and what fields answer about them, for tests of device fields. Not part of the library.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "octrad/base/query_rays.h"
#include "octrad/device/array.h"
#include "octrad/model/device_field.h"

namespace octrad::testing {

struct DeviceBatch {
  // All that a point may have traced.
  static QueryRays everything() {
    QueryRays rays;
    rays.lobe = 1;
    rays.offset.reflected = true;
    return rays;
  }
  DeviceBatch(Stream& stream, const std::vector<SurfacePoint>& p, const std::vector<Vec3f>& t = {})
      : n(p.size()),
        targets(stream, std::span<const Vec3f>(t), "targets") {
    std::vector<float> numbers(static_cast<std::size_t>(surface_point_numbers(everything())) * n);
    const SurfacePointArray host = surface_point_array(numbers.data(), n, everything());
    for (std::size_t i = 0; i < n; ++i) host.store_all(i, p[i]);
    data = DeviceArray<float>(stream, std::span<const float>(numbers), "points");
  }
  SurfacePointArray points() const { return surface_point_array(data.data(), n, everything()); }
  std::size_t n;
  DeviceArray<float> data;
  DeviceArray<Vec3f> targets;
};

// Three numbers a point.
inline std::vector<float> as_floats(const std::vector<Vec3f>& values) {
  std::vector<float> result;
  for (const Vec3f& v : values) {
    for (int c = 0; c < 3; ++c) result.push_back(v[c]);
  }
  return result;
}
inline std::vector<float> ask(Stream& stream, DeviceField& field, const std::vector<SurfacePoint>& points) {
  const DeviceBatch batch(stream, points);
  DeviceArray<Vec3f> out(stream, points.size(), "out");
  field.radiance(batch.points(), nullptr, points.size(), out.data());
  return as_floats(out.download());
}

// How an array may differ from the definition's; differences are relative to the root mean square of those expected
// numbers that are not 0, and numbers that are 0 in both count for nothing.
struct Limits {
  double median;
  double tolerance, share;  // at most this share differs by more than the tolerance
  double worst;
};

template <typename Got, typename Expected>
void expect_within(const Limits& limits, const std::vector<Got>& got, const std::vector<Expected>& expected,
                   const std::string& what) {
  ASSERT_EQ(got.size(), expected.size()) << what;
  double square = 0.0, count = 0.0;
  std::vector<double> differences;
  for (std::size_t i = 0; i < got.size(); ++i) {
    const auto g = static_cast<double>(got[i]), e = static_cast<double>(expected[i]);
    square += e * e;
    count += e != 0.0 ? 1.0 : 0.0;
    if (g != 0.0 || e != 0.0) differences.push_back(std::isfinite(g) ? std::abs(g - e) : HUGE_VAL);
  }
  if (differences.empty()) return;
  const double unit = std::sqrt(square / std::max(count, 1.0)) + 1e-30;
  for (double& d : differences) d /= unit;
  std::sort(differences.begin(), differences.end());
  const auto beyond = differences.end() - std::upper_bound(differences.begin(), differences.end(), limits.tolerance);
  const double share = static_cast<double>(beyond) / static_cast<double>(differences.size());
  EXPECT_LE(differences[differences.size() / 2], limits.median) << what;
  EXPECT_LE(share, limits.share) << what << ", beyond " << limits.tolerance;
  EXPECT_LE(differences.back(), limits.worst) << what;
}

}  // namespace octrad::testing
