// What a look-up is given of the surface that its direction leads to (lookup.reflected = features; method section 4):
// the features stored there, and its attributes as inputs of the decoder. The definition, for host and device.
#pragma once

#include <cmath>

#include "octrad/base/lookup_rule.h"
#include "octrad/model/decoder_math.h"

namespace octrad {

inline constexpr int kReflectedInputs = 14;  // n (3), albedo (3), alpha, met, log emission (3), position (3)

// The direction of the ray that met it; w: that of the look-up.
OCTRAD_HD inline Vec3f ray_direction(const ReflectedSurface& r, Vec3f w) { return dot(r.w, r.w) > 0.0f ? r.w : w; }

// Where the features are looked up: the end of the ray from x along its direction w, 1 / disparity away.
OCTRAD_HD inline Vec3f reflected_position(Vec3f x, Vec3f w, float disparity) { return x + w * (1.0f / disparity); }

// The direction of that look-up: as that of a point there, seen from x along w. Its disparity is 0.
OCTRAD_HD inline Vec3f reflected_direction(const LookupRule& rule, const ReflectedSurface& r, Vec3f w) {
  SurfacePoint there;
  there.n = r.n;
  there.wo = -w;
  there.alpha = r.alpha;
  return lookup_direction(rule, there);
}

// Whether anything is looked up there.
OCTRAD_HD inline bool has_reflected(const LookupRule& rule, const SurfacePoint& p, float disparity) {
  return rule.has_offset(p.alpha) && p.reflected.met > 0.0f && disparity > 0.0f;
}

// out[0 .. kReflectedInputs - 1]; all 0 where the look-up has no offset. `position`: of the end of the ray, in [-1, 1]
// of the domain, contracted outside. `exposure`: of the field; emission counts in its unit, which in the dark is
// as good as none.
OCTRAD_HD inline void reflected_inputs(const LookupRule& rule, const SurfacePoint& p, float disparity, Vec3f position,
                                       float exposure, float* out) {
  const ReflectedSurface& r = p.reflected;
  const bool asked = rule.has_offset(p.alpha), met = has_reflected(rule, p, disparity);
  OCTRAD_UNROLL
  for (int c = 0; c < 3; ++c) {
    out[c] = met ? r.n[c] : 0.0f;
    out[3 + c] = met ? r.albedo[c] : 0.0f;
    out[8 + c] = asked ? std::log1p(r.emitted[c] / (exposure > 1e-20f ? exposure : 1e-20f)) : 0.0f;
    out[11 + c] = met ? position[c] : 0.0f;
  }
  out[6] = met ? r.alpha : 0.0f;
  out[7] = met ? 1.0f : 0.0f;
}

}  // namespace octrad
