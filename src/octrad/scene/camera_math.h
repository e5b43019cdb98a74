// Camera rays of a picture of a given size, and the samples of a picture: plain data for host and device.
#pragma once

#include <cmath>

#include "octrad/base/rng.h"
#include "octrad/scene/ray.h"

namespace octrad {

struct CameraView {
  Vec3f origin, right, up, forward;
  Vec2f principal_point_offset;
  float tan_x = 0.0f, tan_y = 0.0f;      // of half the angles of view
  float near_clip = 0.0f, depth = 0.0f;  // depth: between the clipping planes
  int width = 0, height = 0;             // pixels
};

// Ray through `pixel` (continuous, [0, width] x [0, height], row 0 at the top), from the near to the far clipping
// plane.
OCTRAD_HD inline Ray camera_ray(const CameraView& view, Vec2f pixel) {
  const float x = pixel.x / static_cast<float>(view.width) + view.principal_point_offset.x;
  const float y = pixel.y / static_cast<float>(view.height) + view.principal_point_offset.y;
  const Vec3f to_plane = view.forward + view.right * ((2.0f * x - 1.0f) * view.tan_x) +
                         view.up * ((1.0f - 2.0f * y) * view.tan_y);  // depth 1
  const float l = length(to_plane);
  return {view.origin + to_plane * view.near_clip, to_plane / l, view.depth * l};
}

// One primary ray, from the near to the far clipping plane, with the random stream of its pixel and sample.
struct CameraSample {
  Ray ray;
  Rng rng;         // generator of the sample, after the position was drawn from it
  Vec2f position;  // on the film, pixels
};

// Where sample `i` of pixel (x, y) lies: uniform in the pixel. Each depends on (seed, pixel, i) alone.
OCTRAD_HD inline Vec2f camera_sample_position(Rng& rng, int x, int y) {
  const Vec2f u = rng.uniform2();
  // Rounding must not carry a position into the next pixel.
  return {std::fmin(static_cast<float>(x) + u.x, nextafterf(static_cast<float>(x + 1), 0.0f)),
          std::fmin(static_cast<float>(y) + u.y, nextafterf(static_cast<float>(y + 1), 0.0f))};
}

OCTRAD_HD inline Rng camera_sample_generator(const CameraView& view, unsigned long long seed, int x, int y, int i) {
  const std::uint64_t pixels = static_cast<std::uint64_t>(view.width) * static_cast<std::uint64_t>(view.height);
  const std::uint64_t pixel =
      static_cast<std::uint64_t>(y) * static_cast<std::uint64_t>(view.width) + static_cast<std::uint64_t>(x);
  return Rng(seed, RngPurpose::pixel, static_cast<std::uint64_t>(i) * pixels + pixel);
}

OCTRAD_HD inline CameraSample camera_sample(const CameraView& view, unsigned long long seed, int x, int y, int i) {
  Rng rng = camera_sample_generator(view, seed, x, y, i);
  const Vec2f position = camera_sample_position(rng, x, y);
  return {camera_ray(view, position), rng, position};
}

}  // namespace octrad
