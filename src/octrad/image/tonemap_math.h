// From linear radiance to what a screen shows, one value: for host and device.
#pragma once

#include <cmath>

#include "octrad/base/hd.h"

namespace octrad {

struct ToneMapping {
  enum class Curve { none, log1p, filmic };     // applied after exposure: x, ln(1 + x), or filmic_curve(x)
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
// For the colours of scene files.
inline double decode_srgb(double encoded) {
  return encoded <= 0.04045 ? encoded / 12.92 : std::pow((encoded + 0.055) / 1.055, 2.4);
}

// An S-shaped curve that rolls highlights off: Krzysztof Narkowicz's fit of the ACES reference curve ("ACES Filmic Tone
// Mapping Curve", 2016), for values from 0 on; 0.18 becomes 0.27, 1 becomes 0.80, and from 7.3 on all is white.
OCTRAD_HD inline float filmic_curve(float x) {
  // At 1e4 the curve has long ended above 1; squares of larger values could overflow.
  const float v = x < 1e4f ? x : 1e4f;
  return v * (2.51f * v + 0.03f) / (v * (2.43f * v + 0.59f) + 0.14f);
}

// One channel value through `mapping`, in [0, 1]. NaN gives 0.
OCTRAD_HD inline float tonemap(float value, const ToneMapping& mapping) {
  float v = value * std::exp2(mapping.exposure);
  if (!(v > 0.0f)) return 0.0f;  // negative or NaN
  if (mapping.curve == ToneMapping::Curve::log1p) v = std::log1p(v);
  else if (mapping.curve == ToneMapping::Curve::filmic) v = filmic_curve(v);
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
