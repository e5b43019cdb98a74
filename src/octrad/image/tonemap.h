// From linear radiance to what a screen shows.
#pragma once

#include "octrad/image/image.h"
#include "octrad/image/io.h"
#include "octrad/image/tonemap_math.h"

namespace octrad {

// The colour of `image` (extract_rgb with `layer`) as 8-bit RGB, rounded to nearest.
Image8 tonemap(const Image& image, const ToneMapping& mapping, const std::string& layer = "");

// One channel of `image` in false colours, black (lower or less) over violet and orange to white (upper or more);
// values that are not finite are green. Throws InputError unless lower < upper.
Image8 false_color(const Image& image, int channel, float lower, float upper);

}  // namespace octrad
