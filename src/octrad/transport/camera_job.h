// Which camera samples a device takes: kept in device memory, so that a recorded graph can be replayed with another
// view or the next samples. And their results.
#pragma once

#include "octrad/scene/camera_math.h"
#include "octrad/transport/follow_math.h"
#include "octrad/transport/queue_math.h"

namespace octrad {

// Samples [first, first + count) of every pixel of a window of the picture. Sample k of the job is sample first + k %
// count of the pixel k / count, row after row.
struct CameraJob {
  CameraView view;  // of the whole picture
  unsigned long long seed = 0;
  int x0 = 0, y0 = 0, width = 0, height = 0;
  int first = 0, count = 0;

  struct Place {
    int x, y, i;
  };

  OCTRAD_HD std::uint32_t size() const {
    return static_cast<std::uint32_t>(width) * static_cast<std::uint32_t>(height) * static_cast<std::uint32_t>(count);
  }
  OCTRAD_HD Place place(std::uint32_t k) const {
    const auto samples = static_cast<std::uint32_t>(count), columns = static_cast<std::uint32_t>(width);
    const std::uint32_t pixel = k / samples;
    return {x0 + static_cast<int>(pixel % columns), y0 + static_cast<int>(pixel / columns),
            first + static_cast<int>(k % samples)};
  }
  OCTRAD_HD CameraSample sample(std::uint32_t k) const {
    const Place p = place(k);
    return camera_sample(view, seed, p.x, p.y, p.i);
  }
};

// Radiance 0..2 and the first hit's albedo 3..5, normal 6..8, depth 9 and roughness 10 of each sample.
inline constexpr int kSampleNumbers = 11;

struct SamplePlanes : FloatPlanes {
  OCTRAD_HD Vec3f radiance(std::size_t k) const { return get3(0, k); }
  OCTRAD_HD void set_radiance(std::size_t k, Vec3f v) const { set3(0, k, v); }
  OCTRAD_HD void set_first(std::size_t k, const FirstHit& first) const {
    set3(3, k, first.albedo);
    set3(6, k, first.normal);
    set(9, k, first.depth);
    set(10, k, first.roughness);
  }
};

}  // namespace octrad
