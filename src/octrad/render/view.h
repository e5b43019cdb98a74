// What a picture shows: a camera, the size of the picture, and the part of it that is wanted.
#pragma once

#include <algorithm>
#include <cstdint>
#include <memory>
#include <vector>

#include "octrad/scene/camera.h"

namespace octrad {

struct Crop {
  int x = 0, y = 0, width = 0, height = 0;  // width 0: the whole picture
};

// A part of a picture, half-open.
struct PixelRect {
  int x0 = 0, y0 = 0, x1 = 0, y1 = 0;
  int width() const { return x1 - x0; }
  int height() const { return y1 - y0; }
  bool operator==(const PixelRect&) const = default;
};

struct View {
  Camera camera;
  int width = 0, height = 0;  // of the whole picture, pixels
  Crop crop = {};             // only this part is rendered and returned
  // One byte a pixel of the whole picture, row by row: where it is 0 the result is 0, and no samples are taken.
  // Null: every pixel.
  std::shared_ptr<const std::vector<std::uint8_t>> mask = {};

  // The pixels that are returned.
  PixelRect part() const {
    return crop.width > 0 ? PixelRect{crop.x, crop.y, crop.x + crop.width, crop.y + crop.height}
                          : PixelRect{0, 0, width, height};
  }
  // How many of these the mask has.
  long long wanted_pixels() const {
    const PixelRect rect = part();
    long long n = 0;
    for (int y = rect.y0; y < rect.y1; ++y) {
      for (int x = rect.x0; x < rect.x1; ++x) n += wants(x, y) ? 1 : 0;
    }
    return n;
  }
  bool wants(int x, int y) const {
    return !mask ||
           (*mask)[static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x)] != 0;
  }
};

// The pixels of a view.
struct FilmWindow {
  PixelRect crop;     // what is returned
  PixelRect sampled;  // pixels around it whose samples the filter carries into it, too
  // With a mask, one byte a pixel of `sampled`, row by row: 0 where no sample is needed. Empty: needed everywhere.
  std::vector<std::uint8_t> needed = {};

  bool needs(int x, int y) const {
    return needed.empty() ||
           needed[static_cast<std::size_t>(y - sampled.y0) * static_cast<std::size_t>(sampled.width()) +
                  static_cast<std::size_t>(x - sampled.x0)] != 0;
  }
  // Pixels that get samples.
  long long sampled_pixels() const {
    if (!needed.empty()) return static_cast<long long>(needed.size()) - std::count(needed.begin(), needed.end(), 0);
    return static_cast<long long>(sampled.width()) * sampled.height();
  }
};

}  // namespace octrad
