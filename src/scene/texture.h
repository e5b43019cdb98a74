// Textures: constants, bitmaps and checkerboards, as in Mitsuba 3.
#pragma once

#include <vector>

#include "base/vec.h"

namespace octrad {

struct Texture {
  enum class Kind { constant, bitmap, checkerboard };
  enum class Filter { nearest, bilinear };
  enum class Wrap { repeat, mirror, clamp };
  Kind kind = Kind::constant;
  Vec3f color0{0.4f, 0.4f, 0.4f};  // constant value, or the checkerboard's first colour
  Vec3f color1{0.2f, 0.2f, 0.2f};
  float to_uv[6] = {1, 0, 0, 0, 1, 0};  // row-major 2x3: uv' = A (u, v, 1)
  Filter filter = Filter::bilinear;
  Wrap wrap = Wrap::repeat;
  int width = 0, height = 0;
  std::vector<Vec3f> pixels;       // linear RGB [height][width], row 0 = v 0 after Mitsuba's flip convention (see texture.cc)
};

// Linear RGB at surface coordinates `uv`. Scalar textures are read from .x (a grey file) or by luminance at load time.
Vec3f evaluate(const Texture& texture, Vec2f uv);
// Derivatives of the first channel with respect to u and v (for bump maps), in texture space after to_uv.
Vec2f gradient(const Texture& texture, Vec2f uv);

}  // namespace octrad
