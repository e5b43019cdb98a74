// Points in device memory and what fields answer about them, for tests of device fields. Not part of the library.
#pragma once

#include <vector>

#include "octrad/device/array.h"
#include "octrad/model/device_field.h"

namespace octrad::testing {

struct DeviceBatch {
  DeviceBatch(Stream& stream, const std::vector<SurfacePoint>& p, const std::vector<Vec3f>& t = {})
      : n(p.size()),
        targets(stream, std::span<const Vec3f>(t), "targets") {
    std::vector<float> numbers(kSurfacePointNumbers * n);
    const SurfacePointArray host{numbers.data(), n};
    for (std::size_t i = 0; i < n; ++i) host.store(i, p[i]);
    data = DeviceArray<float>(stream, std::span<const float>(numbers), "points");
  }
  SurfacePointArray points() const { return {data.data(), n}; }
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

}  // namespace octrad::testing
