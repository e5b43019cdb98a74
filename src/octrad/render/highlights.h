// Whether small lamps shine on glossy surfaces: their highlights are too sharp and too bright for what a cache holds,
// and one bounce at the first hit shows them (render.highlights).
#pragma once

#include "octrad/base/follow_rules.h"
#include "octrad/model/config.h"
#include "octrad/transport/prepared_scene.h"

namespace octrad {

// The share of lamps of less than kSmallLamp steradians, as seen from where their light falls, in the light that would
// reach the scene's surfaces with roughness below `alpha_below` that rays do not follow (is_followed), were nothing in
// its way. From some thousand points and light samples; no ray is cast. The same for the same scene.
inline constexpr double kSmallLamp = 0.01;  // a disk of radius 3.2 degrees
double small_lamp_share(const PreparedScene& scene, float alpha_below, float follow_below = kFollowDelta);

// Roughness below which `lhs` takes one bounce at the first hit: render.bounce_below where render.highlights is
// `bounce`, or `auto` and small lamps have a share above kShareThatMatters; else 0.
inline constexpr double kShareThatMatters = 0.1;
float bounce_below(const PreparedScene& scene, const Config& config);

}  // namespace octrad
