// What is traced from a point before a field is asked there, and arrays of points with room for it.
#pragma once

#include <cstddef>

#include "octrad/base/lookup_rule.h"
#include "octrad/base/surface_point.h"

namespace octrad {

// A ray from a point along its look-up direction, or about it, whose length gives SurfacePoint::disparity.
struct OffsetRay {
  bool traced = false;
  LookupRule rule;
  bool reflected = false;  // where it ends is shaded, for SurfacePoint::reflected
  // In pictures: above 0 the ray from a glossy point is drawn about that direction (draw_offset_direction()).
  float spread = 0.0f;
};

// What is traced from a point before a field is asked there; the field says it (FieldEntry::rays).
struct QueryRays {
  OffsetRay offset;
  int lobe = 0;  // drawn from the BSDF where alpha is below `lobe_below`, at most kMostLobeRays
  float lobe_below = 0.0f;
  int clusters = kHitClusters, iterations = 0;  // of k-means over their distances

  OCTRAD_HD int lobe_rays(float alpha) const { return alpha < lobe_below ? lobe : 0; }
  OCTRAD_HD int count(float alpha) const {
    return static_cast<int>(offset.traced && offset.rule.has_offset(alpha)) + lobe_rays(alpha);
  }
};

// Arrays for points that are one piece of memory, with behind them what is traced from points besides a disparity: how
// many numbers a point has there, and the arrays.
inline int surface_point_numbers(const OffsetRay& offset) {
  return kSurfacePointNumbers + (offset.reflected ? ReflectedArray::kNumbers : 0);
}
inline int surface_point_numbers(const QueryRays& rays) {
  return surface_point_numbers(rays.offset) + (rays.lobe > 0 ? kHitClusterNumbers : 0);
}
inline SurfacePointArray surface_point_array(float* data, std::size_t stride, const QueryRays& rays) {
  SurfacePointArray points{data, stride};
  float* next = data + static_cast<std::size_t>(kSurfacePointNumbers) * stride;
  if (rays.offset.reflected) {
    points.reflected = {next, stride};
    next += static_cast<std::size_t>(ReflectedArray::kNumbers) * stride;
  }
  if (rays.lobe > 0) points.lobe = {next, stride};
  return points;
}

}  // namespace octrad
