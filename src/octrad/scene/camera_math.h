// Camera rays of a picture of a given size, and the samples of a picture: plain data for host and device.
#pragma once

#include <cmath>

#include "octrad/base/circle_math.h"
#include "octrad/base/rng.h"
#include "octrad/scene/ray.h"

namespace octrad {

enum class CameraKind { perspective, thinlens, orthographic };

struct CameraView {
  CameraKind kind = CameraKind::perspective;
  Vec3f origin, right, up, forward;
  Vec2f window_offset{0, 0}, window_scale{1, 1};  // picture [0, 1]^2 -> film
  float tan_x = 0.0f, tan_y = 0.0f;               // of half the angles of view; orthographic: half the film's size
  float near_clip = 0.0f, depth = 0.0f;           // depth: between the clipping planes
  float aperture_radius = 0.0f, focus_distance = 0.0f;  // thinlens
  int width = 0, height = 0;                            // pixels
};

// Ray through `pixel` (continuous, [0, width] x [0, height], row 0 at the top), from the near (as in
// Mitsuba 3) to the far clipping plane. `lens`: uniform in [0, 1)^2, the point of the lens; (0, 0) is its centre.
OCTRAD_HD inline Ray camera_ray(const CameraView& view, Vec2f pixel, Vec2f lens = {0.0f, 0.0f}) {
  const float x = pixel.x / static_cast<float>(view.width) * view.window_scale.x + view.window_offset.x;
  const float y = pixel.y / static_cast<float>(view.height) * view.window_scale.y + view.window_offset.y;
  const Vec3f across =
      view.right * ((2.0f * x - 1.0f) * view.tan_x);  // of the film, at depth 1 where there is a perspective
  const Vec3f along = view.up * ((1.0f - 2.0f * y) * view.tan_y);
  if (view.kind == CameraKind::orthographic)
    return {view.origin + across + along + view.forward * view.near_clip, view.forward, view.depth};
  Vec3f to_plane = view.forward + across + along;  // depth 1
  Vec3f origin = view.origin;
  if (view.kind == CameraKind::thinlens) {
    // From the point of the lens to where the ray through its centre meets the plane in focus.
    const Vec2f at = circle_point(lens.y) * (view.aperture_radius * std::sqrt(lens.x));
    const Vec3f aperture = view.right * at.x + view.up * at.y;
    to_plane = to_plane - aperture / view.focus_distance;
    origin = origin + aperture;
  }
  const float l = length(to_plane);
  return {origin + to_plane * view.near_clip, to_plane / l, view.depth * l};
}

// The same through a random point of the lens, where there is one.
OCTRAD_HD inline Ray sample_camera_ray(const CameraView& view, Vec2f pixel, Rng& rng) {
  return camera_ray(view, pixel, view.kind == CameraKind::thinlens ? rng.stratified2() : Vec2f{0.0f, 0.0f});
}

// Side of what a pixel sees at a distance.
OCTRAD_HD inline double pixel_footprint(const CameraView& view, double distance) {
  const float pixels = std::sqrt(static_cast<float>(view.width) * static_cast<float>(view.height));
  const float tangent = std::sqrt(view.tan_x * view.tan_y) * std::sqrt(view.window_scale.x * view.window_scale.y);
  return (view.kind == CameraKind::orthographic ? 1.0 : distance) * static_cast<double>(2.0f * tangent / pixels);
}

// One primary ray, from the near to the far clipping plane, with the random stream of its pixel and sample.
struct CameraSample {
  Ray ray;
  Rng rng;         // generator of the sample, after the position and the point of the lens were drawn from it
  Vec2f position;  // on the film, pixels
  int number = 0;  // among those of its pixel
};

// Where sample `i` of pixel (x, y) lies: uniform in the pixel, and stratified over a pixel's samples. Each depends on
// (seed, pixel, i) alone.
OCTRAD_HD inline Vec2f camera_sample_position(Rng& rng, int x, int y) {
  const Vec2f u = rng.stratified2();
  // Rounding must not carry a position into the next pixel.
  return {std::fmin(static_cast<float>(x) + u.x, nextafterf(static_cast<float>(x + 1), 0.0f)),
          std::fmin(static_cast<float>(y) + u.y, nextafterf(static_cast<float>(y + 1), 0.0f))};
}

OCTRAD_HD inline Rng camera_sample_generator(const CameraView& view, unsigned long long seed, int x, int y, int i) {
  const std::uint64_t pixel =
      static_cast<std::uint64_t>(y) * static_cast<std::uint64_t>(view.width) + static_cast<std::uint64_t>(x);
  return Rng::of_sample(seed, RngPurpose::pixel, pixel, static_cast<std::uint32_t>(i));
}

OCTRAD_HD inline CameraSample camera_sample(const CameraView& view, unsigned long long seed, int x, int y, int i) {
  Rng rng = camera_sample_generator(view, seed, x, y, i);
  const Vec2f position = camera_sample_position(rng, x, y);
  const Ray ray = sample_camera_ray(view, position, rng);
  return {ray, rng, position, i};
}

}  // namespace octrad
