// How rays pass surfaces like mirrors (render.delta, render.trace_below: method section 8).
#pragma once

#include "octrad/base/hd.h"

namespace octrad {

// Roughness below which rays follow surfaces like mirrors (is_followed): this value means perfect mirrors and glass.
inline constexpr float kFollowDelta = 1e-30f;

// How rays go on over surfaces, and what a field is asked where they end: alike for pictures and right-hand sides.
struct FollowRules {
  float follow_below = 0.0f;     // of is_followed(): which surfaces are passed (0: none)
  int max_chain = 16;            // how many
  bool split_coats = false;      // each lobe of a coated surface is asked for alone (lookup.coats = split)
  bool emission_inside = false;  // the response about an emitter holds its emission (target.emission = inside)
};

}  // namespace octrad
