// Where a cache is trained, drawn over the picture.
#pragma once

#include <span>

#include "octrad/image/image.h"
#include "octrad/render/view.h"

namespace octrad::viewer {

// `base`, darkened and grey, with those of `points` (world space) that the camera sees: the surface in the picture's
// layer depth.Z is not in front of them.
Image8 draw_points(Image8 base, const Image& picture, const View& view, std::span<const Vec3f> points);

}  // namespace octrad::viewer
