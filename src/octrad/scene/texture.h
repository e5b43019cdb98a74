// Textures: constants, bitmaps and checkerboards, as in Mitsuba 3.
#pragma once

#include <vector>

#include "octrad/scene/texture_math.h"

namespace octrad {

struct Texture : TextureSettings {
  // Linear RGB [height][width], row 0 = v 0 after Mitsuba's flip convention (texture_math.h).
  std::vector<Vec3f> pixels;
};

// Holds as long as the pixels stay where they are.
TextureView texture_view(const Texture& texture);

}  // namespace octrad
