// From linear radiance to what a screen shows.
#pragma once

#include "octrad/image/image.h"
#include "octrad/image/tonemap_math.h"

namespace octrad {

// The colour of `image` (extract_rgb with `layer`) as 8-bit RGB, rounded to nearest.
Image8 tonemap(const Image& image, const ToneMapping& mapping, const std::string& layer = "");

// Whether `layer` holds vectors (NAME.X, NAME.Y, NAME.Z), such as normals.
bool is_vector_layer(const Image& image, const std::string& layer);
// A layer of vectors with X, Y, Z from `lower` (0) to `upper` (255) as R, G, B; vectors of length 0, which mean that
// there is none, are black. Throws InputError unless lower < upper and the layer is there.
Image8 vector_color(const Image& image, const std::string& layer, float lower = -1.0f, float upper = 1.0f);

// One channel of `image` in false colours, black (lower or less) over violet and orange to white (upper or more);
// values that are not finite are green. Throws InputError unless lower < upper.
Image8 false_color(const Image& image, int channel, float lower, float upper);

}  // namespace octrad
