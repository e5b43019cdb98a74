// The right-hand side of the rendering equation at given points: one bounce by Monte Carlo, a radiance cache
// queried where the bounce ends (method section 7, paper equation 3).
#pragma once

#include <functional>
#include <span>

#include "octrad/base/follow_rules.h"
#include "octrad/base/query_rays.h"
#include "octrad/transport/context.h"
#include "octrad/transport/direction_guide_math.h"
#include "octrad/transport/far_ends_math.h"
#include "octrad/transport/trace_counts.h"

namespace octrad {

// Predicted radiance of surface points, with their own emission only where RhsOptions::emission_inside is set. All that
// transport needs of a radiance field.
using RadianceQuery = std::function<void(std::span<const SurfacePoint>, std::span<Vec3f>)>;

struct RhsOptions : FollowRules {
  RhsOptions() : FollowRules{.follow_below = kFollowDelta} {}
  explicit RhsOptions(const FollowRules& rules) : FollowRules(rules) {}
  int directions = 16;  // M
  QueryRays rays;       // traced from the points of the queries
  unsigned long long seed = 0;
  unsigned long long stream = 0;             // e.g. the step: streams never share random numbers
  std::span<const unsigned long long> keys;  // sample_key() of the camera samples that saw the points; empty: none did
  GuideView guides;                          // directions are drawn from it as well
  bool learn_guides = false;                 // and it learns from their contributions; needs a query
  float epsilon = 0.0f;                      // of the loss, for what is learnt
  std::span<FarEnd> far_ends;                // filled for the points of far_end_range(); as many as there are places
};

// targets[i] = scattered radiance at points[i] towards its wo, mean of M directions; each is a BSDF sample plus an
// emitter sample under balance-heuristic MIS. A null `query` means a black cache (direct light and chains only).
// Parallel; same bits at any thread count.
TraceCounts estimate_rhs(const TransportContext& context, std::span<const ShadingPoint> points,
                         const RhsOptions& options, const RadianceQuery& query, std::span<Vec3f> targets);

// The same in the caller's thread.
TraceCounts estimate_rhs_serial(const TransportContext& context, std::span<const ShadingPoint> points,
                                const RhsOptions& options, const RadianceQuery& query, std::span<Vec3f> targets);

}  // namespace octrad
