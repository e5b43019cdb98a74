// What a texture's values mean: decides the permitted range and whether colours are reduced to a number. Internal to
// the module.
#pragma once

#include <limits>

#include "octrad/base/vec.h"

namespace octrad {

enum class TextureRole {
  reflectance,  // colour in [0, 1]
  radiance,     // colour >= 0
  opacity,      // scalar in [0, 1]
  roughness,    // scalar in [0, 10]
  index,        // of refraction and absorption: scalar in [0, 1000]
  absorption,   // colour >= 0
  fraction,     // scalar in [0, 1]
  two_sides,    // scalar in [0, 2]
  normal,       // colour in [0, 1] that stands for a direction
  height,       // any scalar
};

inline bool is_scalar(TextureRole role) {
  return role != TextureRole::reflectance && role != TextureRole::radiance && role != TextureRole::absorption &&
         role != TextureRole::normal;
}

// What a constant colour is where it serves as a number: the mean of its channels, as in Mitsuba, whose pictures count
// by their luminance there.
inline float number_of(Vec3f color) {
  const Vec3d c(color);  // three times the same is exactly that
  return static_cast<float>((c.x + c.y + c.z) / 3.0);
}

struct Range {
  float low, high;
  const char* text;
  bool holds(float v, float tolerance = 0.0f) const { return v >= low - tolerance && v <= high + tolerance; }
};

inline Range range_of(TextureRole role) {
  constexpr float kMax = std::numeric_limits<float>::max();
  switch (role) {
    case TextureRole::reflectance: return {0.0f, 1.0f, "a reflectance must be between 0 and 1"};
    case TextureRole::radiance: return {0.0f, kMax, "a radiance must be finite and not negative"};
    case TextureRole::opacity: return {0.0f, 1.0f, "an opacity must be between 0 and 1"};
    case TextureRole::roughness: return {0.0f, 10.0f, "a roughness must be between 0 and 10"};
    case TextureRole::index: return {0.0f, 1000.0f, "an index of refraction must be between 0 and 1000"};
    case TextureRole::absorption: return {0.0f, kMax, "an absorption must be finite and not negative"};
    case TextureRole::fraction: return {0.0f, 1.0f, "the value must be between 0 and 1"};
    case TextureRole::two_sides: return {0.0f, 2.0f, "the value must be between 0 and 2"};
    case TextureRole::normal: return {0.0f, 1.0f, "a normal map's colours must be between 0 and 1"};
    case TextureRole::height: return {-kMax, kMax, "a height must be finite"};
  }
  return {};
}

// What stands for a texture that cannot be used: magenta where it is a colour, and no effect where it is a number.
inline Vec3f stand_in(TextureRole role) {
  switch (role) {
    case TextureRole::reflectance:
    case TextureRole::radiance: return {1.0f, 0.0f, 1.0f};
    case TextureRole::opacity: return Vec3f(1.0f);
    case TextureRole::roughness: return Vec3f(0.1f);
    case TextureRole::index: return Vec3f(1.5f);
    case TextureRole::normal: return {0.5f, 0.5f, 1.0f};
    case TextureRole::absorption:
    case TextureRole::fraction:
    case TextureRole::two_sides:
    case TextureRole::height: break;
  }
  return Vec3f(0.0f);
}

}  // namespace octrad
