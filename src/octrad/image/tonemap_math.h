// From linear radiance to what a screen shows, one value: for host and device.
#pragma once

#include <cmath>

#include "octrad/base/hd.h"

namespace octrad {

struct ToneMapping {
  enum class Curve { none, log1p };             // applied after exposure: x, or ln(1 + x)
  enum class Encoding { srgb, gamma, linear };  // applied after clamping to [0, 1]
  float exposure = 0.0f;                        // stops: radiance is multiplied by 2^exposure
  Curve curve = Curve::none;
  Encoding encoding = Encoding::srgb;
  float gamma = 2.2f;  // of Encoding::gamma: x^(1/gamma)
};

// The sRGB transfer functions (IEC 61966-2-1) for values in [0, 1].
OCTRAD_HD inline float encode_srgb(float linear) {
  return linear <= 0.0031308f ? 12.92f * linear : 1.055f * std::pow(linear, 1.0f / 2.4f) - 0.055f;
}

OCTRAD_HD inline float decode_srgb(float encoded) {
  return encoded <= 0.04045f ? encoded / 12.92f : std::pow((encoded + 0.055f) / 1.055f, 2.4f);
}

// One channel value through `mapping`, in [0, 1]. NaN gives 0.
OCTRAD_HD inline float tonemap(float value, const ToneMapping& mapping) {
  float v = value * std::exp2(mapping.exposure);
  if (!(v > 0.0f)) return 0.0f;  // negative or NaN
  if (mapping.curve == ToneMapping::Curve::log1p) v = std::log1p(v);
  v = v < 1.0f ? v : 1.0f;
  switch (mapping.encoding) {
    case ToneMapping::Encoding::srgb: return encode_srgb(v);
    case ToneMapping::Encoding::gamma: return std::pow(v, 1.0f / mapping.gamma);
    case ToneMapping::Encoding::linear: break;
  }
  return v;
}

// A value of [0, 1] (others are clamped) in 8 bits, rounded to nearest.
OCTRAD_HD inline unsigned char to_byte(float unit) {
  const float v = unit > 0.0f ? (unit < 1.0f ? unit : 1.0f) : 0.0f;
  return static_cast<unsigned char>(std::lround(v * 255.0f));
}

}  // namespace octrad
