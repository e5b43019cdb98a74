// Lights without extent: no ray meets them, and only emitter sampling finds them. Plain data, for host and device.
#pragma once

#include "octrad/base/vec.h"

namespace octrad {

// The weight of an emitter whose `sampling_weight` the scene's file does not state.
inline constexpr float kNoSamplingWeight = -1.0f;

// `to_local` (row-major 3 x 4) takes world space into the light's own, where it looks along +z.
struct DeltaLight {
  enum class Kind { point, spot, directional, projector };
  Kind kind = Kind::point;
  int texture = -1;  // spot: a factor over the square of the cutoff angle; projector: the picture. -1: none
  Vec3f position{0, 0, 0};
  Vec3f axis{0, 0, 1};  // where the light goes: directional, unit; projector: the image of +z, of any length
  // point, spot: radiant intensity; directional: irradiance of a surface facing it; projector: pi times its scale,
  // which is the irradiance at depth 1 on the axis where the picture is 1
  Vec3f intensity{1, 1, 1};
  float to_local[12] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};
  float cos_cutoff = 0.0f, cos_beam = 0.0f;        // spot: nothing outside the first, full intensity inside the second
  float cutoff = 0.0f, inverse_transition = 0.0f;  // spot: radians; 1 / (cutoff - beam width)
  float sampling_weight = kNoSamplingWeight;
  float tan_x = 1.0f, tan_y = 1.0f;  // half the picture (spot: the texture) at depth 1
  bool through_masks = false;        // masks and `null` weaken it by their opacity; else they block it, as in Mitsuba
};

}  // namespace octrad
