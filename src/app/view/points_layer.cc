#include "app/view/points_layer.h"

#include <algorithm>
#include <cmath>

namespace octrad::viewer {
namespace {

// The pixel where `p` is seen; false for what is behind the camera or outside of the picture. camera_ray() the other
// way round, through the centre of the lens.
bool pixel_of(const CameraView& view, Vec3f p, int& x, int& y) {
  const Vec3f v = p - view.origin;
  const float z = view.kind == CameraKind::orthographic ? 1.0f : dot(v, view.forward);
  if (!(z > 0.0f)) return false;
  const float film_x = 0.5f + 0.5f * dot(v, view.right) / (z * view.tan_x),
              film_y = 0.5f - 0.5f * dot(v, view.up) / (z * view.tan_y);
  const float px = (film_x - view.window_offset.x) / view.window_scale.x * static_cast<float>(view.width),
              py = (film_y - view.window_offset.y) / view.window_scale.y * static_cast<float>(view.height);
  if (!(px >= 0.0f && py >= 0.0f && px < static_cast<float>(view.width) && py < static_cast<float>(view.height)))
    return false;
  x = static_cast<int>(px);
  y = static_cast<int>(py);
  return true;
}

}  // namespace

Image8 draw_points(Image8 base, const Image& picture, const View& view, std::span<const Vec3f> points) {
  for (std::size_t i = 0; i + 2 < base.data.size(); i += 3) {
    const int grey = (2 * base.data[i] + 5 * base.data[i + 1] + base.data[i + 2]) / 20;
    for (std::size_t c = 0; c < 3; ++c) base.data[i + c] = static_cast<std::uint8_t>(grey);
  }
  const CameraView camera = view.camera.view(view.width, view.height);
  const int depth = picture.channel("depth.Z");
  for (const Vec3f& p : points) {
    int x = 0, y = 0;
    if (!pixel_of(camera, p, x, y)) continue;
    const float distance = length(p - camera.origin);
    const float seen = depth < 0 ? distance : picture.at(x, y, depth);
    if (std::fabs(seen - distance) > 0.03f * distance + 2.0f * camera.near_clip) continue;
    std::uint8_t* pixel = base.data.data() + 3 * (static_cast<std::size_t>(y) * static_cast<std::size_t>(base.width) +
                                                  static_cast<std::size_t>(x));
    // From orange for one point to white for many.
    constexpr int kFirst[3] = {255, 140, 0};
    for (int c = 0; c < 3; ++c)
      pixel[c] = static_cast<std::uint8_t>(pixel[0] < 255 ? kFirst[c] : std::min(255, pixel[c] + 40));
  }
  return base;
}

}  // namespace octrad::viewer
