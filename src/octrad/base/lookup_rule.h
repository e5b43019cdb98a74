// The direction with which a field is looked up at a point (method sections 1 and 4).
#pragma once

#include "octrad/base/surface_point.h"

namespace octrad {

enum class LookupDirection { mirror, outgoing };  // direction of queries on glossy surfaces
enum class RoughDirection { normal, mirror };     // direction of queries on rough surfaces

// Direction with which a field is looked up at a point, and whether its look-up has an offset (method section 4).
struct LookupRule {
  LookupDirection glossy = LookupDirection::mirror;
  RoughDirection rough = RoughDirection::normal;
  float rough_threshold = 0.5f;
  bool rough_offset = true;  // false: the disparity of rough points is 0

  OCTRAD_HD bool has_offset(float alpha) const { return rough_offset || alpha < rough_threshold; }
};

OCTRAD_HD inline Vec3f lookup_direction(const LookupRule& rule, const SurfacePoint& point) {
  if (point.alpha >= rule.rough_threshold && rule.rough == RoughDirection::normal) return point.n;
  return rule.glossy == LookupDirection::mirror ? reflect(point.wo, point.n) : point.wo;
}

}  // namespace octrad
