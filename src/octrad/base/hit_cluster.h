// What rays drawn from the BSDF of a point met, in clusters of like distance (Neural Cone Radiosity, method section 9).
#pragma once

#include <cstddef>

#include "octrad/base/hd.h"

namespace octrad {

// The rays drawn from a point's BSDF that end about equally far away (transport/hit_clusters_math.h).
struct HitCluster {
  float distance = 0.0f;   // mean, world units
  float deviation = 0.0f;  // standard deviation
  float share = 0.0f;      // of all rays drawn, also of those that met nothing; 0: an empty cluster
};
inline constexpr int kHitClusters = 4, kMostLobeRays = 512;
inline constexpr int kHitClusterNumbers = 3 * kHitClusters;

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

}  // namespace octrad
