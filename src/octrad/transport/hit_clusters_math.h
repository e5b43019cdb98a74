// Rays drawn from a point's BSDF, summarised by how far they went: 1-D k-means of their distances (Lloyd 1982), as
// Neural Cone Radiosity has it (Ren et al. 2025; method section 9). The definition, for host and device.
#pragma once

#include <cmath>

#include "octrad/base/hit_cluster.h"

namespace octrad {

// Clusters of the distances t[0 .. n - 1], finite and in any order, of `rays` >= n rays; the others met nothing and
// count in the shares alone. Centres start evenly from the smallest to the largest distance; `iterations` times each
// distance joins the nearest centre (of two as near, the lower) and centres move to the mean of their members. The
// deviation is that of the last members. Fills out[0 .. kHitClusters - 1], of which `clusters` may have members. T: a
// pointer, or what else is indexed like one. All loops over clusters have the same length, so that a device compiler
// keeps their arrays in registers.
OCTRAD_HD_OR_HOST
template <typename T>
OCTRAD_HD inline void cluster_hits(const T& t, int n, int rays, int clusters, int iterations, HitCluster* out) {
  OCTRAD_UNROLL
  for (int k = 0; k < kHitClusters; ++k) out[k] = {};
  if (n == 0) return;
  float low = t[0], high = t[0];
  for (int i = 1; i < n; ++i) {
    low = lesser(low, t[i]);
    high = greater(high, t[i]);
  }
  // Relative to the smallest distance: sums lose less.
  float center[kHitClusters], members[kHitClusters], edge[kHitClusters] = {}, below[kHitClusters] = {};
  OCTRAD_UNROLL
  for (int k = 0; k < kHitClusters; ++k) {
    center[k] = clusters > 1 ? (high - low) * static_cast<float>(k) / static_cast<float>(clusters - 1) : 0.0f;
    members[k] = 0.0f;
  }
  for (int step = 0; step < iterations; ++step) {
    // Cluster k has the distances in (below[k], edge[k]]: centres stay in order. Those from `clusters` on have none.
    OCTRAD_UNROLL
    for (int k = 0; k < kHitClusters; ++k) {
      edge[k] = k + 1 < clusters ? 0.5f * (center[k] + center[k + 1 < kHitClusters ? k + 1 : k]) : high - low;
      if (k >= clusters) edge[k] = -1.0f;
      below[k] = k > 0 ? edge[k - 1] : -1.0f;
    }
    float sum[kHitClusters] = {};
    OCTRAD_UNROLL
    for (int k = 0; k < kHitClusters; ++k) members[k] = 0.0f;
    for (int i = 0; i < n; ++i) {
      // One operation a loop, for all clusters: the form in which compilers make vectors of it.
      const float d = t[i] - low;
      float in[kHitClusters], at_most[kHitClusters];
      OCTRAD_UNROLL
      for (int k = 0; k < kHitClusters; ++k) at_most[k] = d <= edge[k] ? 1.0f : 0.0f;
      OCTRAD_UNROLL
      for (int k = 0; k < kHitClusters; ++k) in[k] = d > below[k] ? at_most[k] : 0.0f;
      OCTRAD_UNROLL
      for (int k = 0; k < kHitClusters; ++k) sum[k] += in[k] * d;
      OCTRAD_UNROLL
      for (int k = 0; k < kHitClusters; ++k) members[k] += in[k];
    }
    bool moved = false;
    OCTRAD_UNROLL
    for (int k = 0; k < kHitClusters; ++k) {
      if (members[k] == 0.0f) continue;  // an empty cluster stays where it is
      const float mean = sum[k] / members[k];
      moved = moved || mean != center[k];
      center[k] = mean;
    }
    if (!moved) break;
  }
  float square[kHitClusters] = {};
  for (int i = 0; i < n; ++i) {
    const float d = t[i] - low;
    float in[kHitClusters], at_most[kHitClusters], apart[kHitClusters];
    OCTRAD_UNROLL
    for (int k = 0; k < kHitClusters; ++k) at_most[k] = d <= edge[k] ? 1.0f : 0.0f;
    OCTRAD_UNROLL
    for (int k = 0; k < kHitClusters; ++k) in[k] = d > below[k] ? at_most[k] : 0.0f;
    OCTRAD_UNROLL
    for (int k = 0; k < kHitClusters; ++k) apart[k] = in[k] * (d - center[k]);
    OCTRAD_UNROLL
    for (int k = 0; k < kHitClusters; ++k) square[k] += apart[k] * apart[k];
  }
  OCTRAD_UNROLL
  for (int k = 0; k < kHitClusters; ++k) {
    if (members[k] == 0.0f) continue;
    out[k] = {low + center[k], std::sqrt(square[k] / members[k]), members[k] / static_cast<float>(rays)};
  }
}

}  // namespace octrad
