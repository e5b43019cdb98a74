// What a radiance field is queried at (method section 1): one point of a surface seen from one direction.
#pragma once

#include <cstddef>

#include "octrad/base/vec.h"

namespace octrad {

// The rays drawn from a point's BSDF that end about equally far away (transport/hit_clusters_math.h).
struct HitCluster {
  float distance = 0.0f;   // mean, world units
  float deviation = 0.0f;  // standard deviation
  float share = 0.0f;      // of all rays drawn, also of those that met nothing; 0: an empty cluster
};
inline constexpr int kHitClusters = 4, kMostLobeRays = 512;
inline constexpr int kHitClusterNumbers = 3 * kHitClusters;

// What a point shows along its look-up direction, or one drawn about it (lookup.reflected): the surface that a ray in
// that direction met.
struct ReflectedSurface {
  float met = 0.0f;        // 1: a surface; 0: the ray left the scene, or was not cast
  float alpha = 0.0f;      // its roughness; of a coated surface that of its base, 1
  Vec3f n{0, 0, 0};        // its unit shading normal, on the side of the point
  Vec3f albedo{0, 0, 0};   // of a coated surface: of its base, towards the point
  Vec3f emitted{0, 0, 0};  // radiance that it emits towards the point; without a surface that of the environment
  Vec3f w{0, 0, 0};  // unit direction of the ray where that was drawn (OffsetRay::spread); 0: the look-up direction
};

struct SurfacePoint {
  Vec3f x;                        // world position
  Vec3f n;                        // unit shading normal, on the side of wo
  Vec3f wo;                       // unit direction towards the viewer; seen through, that whose mirror direction
                                  // is the refracted one (method section 1)
  Vec3f albedo;                   // linear RGB, independent of wo
  float alpha = 1.0f;             // roughness: 1 diffuse, 0 perfectly smooth
  float disparity = 0.0f;         // 1 / length of the ray of QueryRays::offset; 0 without
  ReflectedSurface reflected;     // at that distance, only with OffsetRay::reflected
  HitCluster lobe[kHitClusters];  // what rays drawn from the BSDF met, only with QueryRays::lobe
};

// Roughness below which rays follow surfaces like mirrors (is_followed): this value means perfect mirrors and glass.
inline constexpr float kFollowDelta = 1e-30f;

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

// How rays go on over surfaces, and what a field is asked where they end: alike for pictures and right-hand sides.
struct FollowRules {
  float follow_below = 0.0f;     // of is_followed(): which surfaces are passed (0: none)
  int max_chain = 16;            // how many
  bool split_coats = false;      // each lobe of a coated surface is asked for alone (lookup.coats = split)
  bool emission_inside = false;  // the response about an emitter holds its emission (target.emission = inside)
};

// Clusters of many points: number c of cluster k of point i at [3 k + c][stride] + i.
struct HitClusterArray {
  float* data = nullptr;  // [kHitClusterNumbers][stride]
  std::size_t stride = 0;

  OCTRAD_HD HitCluster get(int k, std::size_t i) const {
    const float* at = data + static_cast<std::size_t>(3 * k) * stride + i;
    return {at[0], at[stride], at[2 * stride]};
  }
  OCTRAD_HD void set(int k, std::size_t i, const HitCluster& cluster) const {
    float* at = data + static_cast<std::size_t>(3 * k) * stride + i;
    at[0] = cluster.distance;
    at[stride] = cluster.deviation;
    at[2 * stride] = cluster.share;
  }
};

// What many points show, likewise.
struct ReflectedArray {
  float* data = nullptr;  // [kNumbers][stride]
  std::size_t stride = 0;
  static constexpr int kNumbers = 14, kDirectionNumber = 11;

  OCTRAD_HD ReflectedSurface get(std::size_t i) const {
    const auto at = [&](int number) { return data[static_cast<std::size_t>(number) * stride + i]; };
    return {at(0), at(1), {at(2), at(3), at(4)}, {at(5), at(6), at(7)}, {at(8), at(9), at(10)}, direction(i)};
  }
  OCTRAD_HD void set(std::size_t i, const ReflectedSurface& r) const {
    const float numbers[kNumbers] = {r.met,      r.alpha,     r.n.x,       r.n.y,       r.n.z, r.albedo.x, r.albedo.y,
                                     r.albedo.z, r.emitted.x, r.emitted.y, r.emitted.z, r.w.x, r.w.y,      r.w.z};
    OCTRAD_UNROLL
    for (int n = 0; n < kNumbers; ++n) data[static_cast<std::size_t>(n) * stride + i] = numbers[n];
  }
  OCTRAD_HD Vec3f direction(std::size_t i) const {
    const float* at = data + kDirectionNumber * stride + i;
    return {at[0], at[stride], at[2 * stride]};
  }
  OCTRAD_HD void set_direction(std::size_t i, Vec3f w) const {
    float* at = data + kDirectionNumber * stride + i;
    at[0] = w.x;
    at[stride] = w.y;
    at[2 * stride] = w.z;
  }
};

// Many points as a structure of arrays: component c of item i at [c][stride] + i, so that accesses of a warp coalesce.
inline constexpr int kSurfacePointNumbers = 14, kAlphaNumber = 12, kDisparityNumber = 13;

struct SurfacePointArray {
  float* data = nullptr;  // [kSurfacePointNumbers][stride]
  std::size_t stride = 0;
  // SurfacePoint::lobe and SurfacePoint::reflected; data null: not known. load() and store() leave them alone.
  HitClusterArray lobe = {};
  ReflectedArray reflected = {};

  // Point i of the result is point `begin` + i.
  OCTRAD_HD SurfacePointArray from(std::size_t begin) const {
    return {data + begin,
            stride,
            {lobe.data != nullptr ? lobe.data + begin : nullptr, lobe.stride},
            {reflected.data != nullptr ? reflected.data + begin : nullptr, reflected.stride}};
  }

  OCTRAD_HD float get(int number, std::size_t i) const { return data[static_cast<std::size_t>(number) * stride + i]; }
  OCTRAD_HD void set(int number, std::size_t i, float value) const {
    data[static_cast<std::size_t>(number) * stride + i] = value;
  }
  OCTRAD_HD Vec3f get3(int number, std::size_t i) const {
    return {get(number, i), get(number + 1, i), get(number + 2, i)};
  }
  OCTRAD_HD SurfacePoint load(std::size_t i) const {
    SurfacePoint p;
    p.x = get3(0, i);
    p.n = get3(3, i);
    p.wo = get3(6, i);
    p.albedo = get3(9, i);
    p.alpha = get(kAlphaNumber, i);
    p.disparity = get(kDisparityNumber, i);
    return p;
  }
  OCTRAD_HD void store(std::size_t i, const SurfacePoint& p) const {
    const float numbers[kSurfacePointNumbers] = {p.x.x,      p.x.y,      p.x.z,   p.n.x,      p.n.y,
                                                 p.n.z,      p.wo.x,     p.wo.y,  p.wo.z,     p.albedo.x,
                                                 p.albedo.y, p.albedo.z, p.alpha, p.disparity};
    for (int n = 0; n < kSurfacePointNumbers; ++n) data[static_cast<std::size_t>(n) * stride + i] = numbers[n];
  }
  // With clusters and what is shown, where there are any.
  SurfacePoint load_all(std::size_t i) const {
    SurfacePoint p = load(i);
    for (int k = 0; k < kHitClusters && lobe.data != nullptr; ++k) p.lobe[k] = lobe.get(k, i);
    if (reflected.data != nullptr) p.reflected = reflected.get(i);
    return p;
  }
  void store_all(std::size_t i, const SurfacePoint& p) const {
    store(i, p);
    for (int k = 0; k < kHitClusters && lobe.data != nullptr; ++k) lobe.set(k, i, p.lobe[k]);
    if (reflected.data != nullptr) reflected.set(i, p.reflected);
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
