// Nothing: light goes straight through (Mitsuba's `null`). Rays pass it as they pass a mask of opacity 0, which its
// materials have (shading/materials.cc).
#pragma once

#include "octrad/shading/bsdf_types.h"

namespace octrad {

struct NullModel {
  static constexpr bool kDeltaOnly = true;

  OCTRAD_HD static BsdfValue evaluate(const Bsdf&, Vec3f, Vec3f) { return {}; }
  OCTRAD_HD static BsdfSample sample(const Bsdf&, Vec3f wo, float, Vec2f) {
    BsdfSample s;
    s.wi = -wo;
    s.weight = Vec3f(1.0f);
    s.pdf = 1.0f;
    s.delta = s.null = s.transmission = s.valid = true;
    return s;
  }
  OCTRAD_HD static Vec3f albedo(const Bsdf&) { return Vec3f(1.0f); }
  OCTRAD_HD static float roughness(const Bsdf&) { return 0.0f; }
};

}  // namespace octrad
