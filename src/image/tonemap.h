// From linear radiance to what a screen shows.
#pragma once

#include "image/image.h"
#include "image/io.h"

namespace octrad {

struct ToneMapping {
  enum class Curve { none, log1p };            // applied after exposure: x, or ln(1 + x)
  enum class Encoding { srgb, gamma, linear }; // applied after clamping to [0, 1]
  float exposure = 0.0f;                       // stops: radiance is multiplied by 2^exposure
  Curve curve = Curve::none;
  Encoding encoding = Encoding::srgb;
  float gamma = 2.2f;                          // of Encoding::gamma: x^(1/gamma)
};

// The sRGB transfer functions (IEC 61966-2-1) for values in [0, 1].
float encode_srgb(float linear);
float decode_srgb(float encoded);

// One channel value through `mapping`, in [0, 1]. NaN gives 0.
float tonemap(float value, const ToneMapping& mapping);

// The colour of `image` (extract_rgb with `layer`) as 8-bit RGB, rounded to nearest.
Image8 tonemap(const Image& image, const ToneMapping& mapping, const std::string& layer = "");

// One channel of `image` in false colours, black (lower or less) over violet and orange to white (upper or more);
// values that are not finite are green. Throws InputError unless lower < upper.
Image8 false_color(const Image& image, int channel, float lower, float upper);

}  // namespace octrad
