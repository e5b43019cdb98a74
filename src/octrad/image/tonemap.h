// From linear radiance to what a screen shows.
#pragma once

#include "octrad/image/image.h"
#include "octrad/image/tonemap_math.h"

namespace octrad {

// The colour of `image` (extract_rgb with `layer`) as 8-bit RGB, rounded to nearest. What is for the screen already is
// decoded first: without exposure and curve it stays as it is.
Image8 tonemap(const Image& image, const ToneMapping& mapping, const std::string& layer = "");

// Whether the values of `image` are for the screen, sRGB-encoded in [0, 1] (PNG, JPEG), and not linear radiance.
bool is_display_referred(const Image& image);
// The colour of `image` as linear values; display-referred ones are decoded.
Image linear_color(const Image& image);
// The colour of `image` as a screen shows it: limited to [0, 1] and sRGB-encoded. NaN gives 0.
Image display_color(const Image& image);
// display_color() as linear values in [0, 1]: what of linear radiance the screen shows.
Image shown_linear_color(const Image& image);

// Whether `layer` holds vectors (NAME.X, NAME.Y, NAME.Z), such as normals.
bool is_vector_layer(const Image& image, const std::string& layer);
// A layer of vectors with X, Y, Z from `lower` (0) to `upper` (255) as R, G, B; vectors of length 0, which mean that
// there is none, are black. Throws InputError unless lower < upper and the layer is there.
Image8 vector_color(const Image& image, const std::string& layer, float lower = -1.0f, float upper = 1.0f);

// Colours at even steps. Luminance rises evenly along the first; the second is for values with a sign.
inline constexpr Vec3f kFalseColors[] = {
    {0.0f, 0.0f, 0.0f}, {0.28f, 0.06f, 0.42f}, {0.72f, 0.16f, 0.40f}, {0.96f, 0.52f, 0.14f}, {1.0f, 1.0f, 0.92f}};
inline constexpr Vec3f kSignedColors[] = {
    {0.05f, 0.15f, 0.45f}, {0.35f, 0.60f, 0.90f}, {1.0f, 1.0f, 1.0f}, {0.95f, 0.50f, 0.35f}, {0.45f, 0.05f, 0.10f}};

// One channel of `image` in false colours, black (lower or less) over violet and orange to white (upper or more);
// values that are not finite are green. Throws InputError unless lower < upper.
Image8 false_color(const Image& image, int channel, float lower, float upper);

// One channel of `image` in false colours: blue where negative, white at 0, red where positive, darkest from -limit and
// limit on; values that are not finite are green. Throws InputError unless limit > 0.
Image8 signed_color(const Image& image, int channel, float limit);

}  // namespace octrad
