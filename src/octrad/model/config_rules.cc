// What several keys of a configuration say together.
#include <fmt/format.h>

#include <algorithm>

#include "octrad/base/error.h"
#include "octrad/encoding/octaoctree_math.h"
#include "octrad/model/config.h"

namespace octrad {
namespace {

float follow_below(const Config& config) {
  if (config.render_delta != DeltaSurfaces::trace) return 0.0f;
  // Light sampled at a near mirror would be counted again by a response that holds the emission.
  if (config.target_emission == TargetEmission::inside) return kFollowDelta;
  return std::max(kFollowDelta, static_cast<float>(config.render_trace_below));
}

}  // namespace

int octree_levels(const Config& config) {
  const int levels = config.octree_levels + config.octree_fine;
  if (levels <= kMaxOctreeLevels) return levels;
  throw UsageError(fmt::format("octree.levels = {} and octree.fine = {} are {} levels, supported are {} together",
                               config.octree_levels, config.octree_fine, levels, kMaxOctreeLevels));
}

// Responses of both lobes would hold the emission of the surface.
bool split_coats(const Config& config) {
  return config.lookup_coats == Coats::split && config.target_emission == TargetEmission::outside;
}

FollowRules first_hit_rules(const Config& config) {
  return {follow_below(config), config.train_max_chain, split_coats(config),
          config.target_emission == TargetEmission::inside};
}

FollowRules rhs_rules(const Config& config) {
  FollowRules rules = first_hit_rules(config);
  rules.follow_below = std::max(kFollowDelta, rules.follow_below);
  return rules;
}

bool looks_up_reflected(const Config& config) {
  return config.lookup_reflected == Reflected::features && config.lookup_offset == LookupOffset::traced;
}

LookupRule lookup_rule(const Config& config) {
  return {config.lookup_direction, config.lookup_rough_direction, static_cast<float>(config.lookup_rough_threshold),
          config.lookup_rough_offset};
}

}  // namespace octrad
