// What a picture shows: a camera, the size of the picture, and the part of it that is wanted.
#pragma once

#include "octrad/scene/scene.h"

namespace octrad {

struct Crop {
  int x = 0, y = 0, width = 0, height = 0;  // width 0: the whole picture
};

struct View {
  Camera camera;
  int width = 0, height = 0;  // of the whole picture, pixels
  Crop crop = {};             // only this part is rendered and returned
};

// A part of a picture, half-open.
struct PixelRect {
  int x0 = 0, y0 = 0, x1 = 0, y1 = 0;
  int width() const { return x1 - x0; }
  int height() const { return y1 - y0; }
  bool operator==(const PixelRect&) const = default;
};

// The pixels of a view.
struct FilmWindow {
  PixelRect crop;     // what is returned
  PixelRect sampled;  // pixels around it whose samples the filter carries into it, too
};

}  // namespace octrad
