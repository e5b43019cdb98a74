// How likely each emitter, and each part of the environment, should be sampled: measured in the scene (method section
// 7).
#pragma once

#include <optional>
#include <vector>

#include "octrad/shading/environment_map.h"
#include "octrad/transport/context.h"

namespace octrad {

// Weights for Lights::set_weights(), one for each emitter of `world`; their sum is 1. Paths from the sensors are
// followed for a few vertices. At each of them emitters are sampled one by one: emitter i brings c_i, with the weight
// of the balance heuristic, and all together about L. The expected square of the relative error of an estimate that
// picks emitter i with probability p_i is the mean of the sum of (c_i / L)^2 / p_i; it is least where p_i is in
// proportion to the root of the mean of (c_i / L)^2. A part of the probability is the same for all emitters, so that
// one that lights a place which few paths met is found there: kUniformPicks, and more where an emitter was sampled
// seldom. Parallel; same bits at any thread count. Some 10,000 shadow rays for ten emitters, at most a million for
// thousands.
inline constexpr double kUniformPicks = 0.2;
std::vector<float> light_weights(const TransportContext& world);

// Where from the environment is drawn, for Lights::set_environment_places(), by the same rule in each of 4^3 places of
// the box where paths are: directions of walls are drawn less often than those of windows. A fifth of the samples stays
// as it was; a part of the map that was sampled seldom at a place is taken to be there as it is everywhere. Nothing
// where there is nothing to measure. Parallel; same bits at any thread count. At most 131,072 shadow rays.
std::optional<EnvironmentPlaces> environment_places(const TransportContext& world);

}  // namespace octrad
