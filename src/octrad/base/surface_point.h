// What a radiance field is queried at (method section 1): one point of a surface seen from one direction.
#pragma once

#include <cstddef>

#include "octrad/base/hit_cluster.h"
#include "octrad/base/reflected_surface.h"
#include "octrad/base/vec.h"

namespace octrad {

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

}  // namespace octrad
