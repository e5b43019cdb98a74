// Textures: constants, bitmaps and checkerboards, as in Mitsuba 3.
#pragma once

#include <vector>

#include "octrad/scene/texture_math.h"

namespace octrad {

struct Texture : TextureSettings {
  std::vector<Vec3f>
      pixels;  // linear RGB [height][width], row 0 = v 0 after Mitsuba's flip convention (see texture_math.h)
};

// Holds as long as the pixels stay where they are.
TextureView texture_view(const Texture& texture);

// Linear RGB at surface coordinates `uv`. Scalar textures are read from .x (a grey file) or by luminance at load time.
Vec3f evaluate(const Texture& texture, Vec2f uv);
// Derivatives of the first channel with respect to u and v (for bump maps), in texture space after to_uv.
Vec2f gradient(const Texture& texture, Vec2f uv);

}  // namespace octrad
