// Far ends of right-hand-side rays as left-hand-side points of the next step (train.far_ends), for host and device.
//
// A target is as good as the cache's responses that went into it. For a share of a step's points, one ray's end is
// kept, drawn in proportion to what the response there contributed to the target, and the next step trains the cache
// there and in that direction. Points drawn so follow the paths by which light arrives, in proportion to what they
// carry.
#pragma once

#include "octrad/base/rng.h"
#include "octrad/geometry/hit.h"
#include "octrad/shading/shading_point.h"

namespace octrad {

// The last segment of a ray: all that is needed to shade its end again.
struct FarEnd {
  Vec3f origin, direction;
  Hit hit;  // invalid: there is none, as no response contributed to the target
  Lobe lobe = Lobe::all;
};

// A step keeps far ends of the points first, first + 1, ..., first + count - 1, modulo the number of its points: others
// in every step, since a point that replaces itself would walk on for ever.
struct FarEndRange {
  std::uint32_t first = 0, count = 0;

  // Place of point i, or `count` where no end of it is kept.
  OCTRAD_HD std::uint32_t place(std::uint32_t i, std::uint32_t points) const {
    const std::uint32_t k = i >= first ? i - first : i + points - first;
    return k < count ? k : count;
  }
};

OCTRAD_HD inline FarEndRange far_end_range(unsigned long long step, std::uint32_t points, std::uint32_t count) {
  return {static_cast<std::uint32_t>(mix64(step + 1) % points), count};
}

// Draws one of several ends in proportion to their weights (reservoir sampling), one after the other.
class FarEndChoice {
 public:
  OCTRAD_HD FarEndChoice(unsigned long long seed, unsigned long long step, std::uint32_t point)
      : rng_(seed, RngPurpose::far_end, mix64(step + 1) ^ point) {}

  // Whether the end with this contribution replaces the one chosen so far.
  OCTRAD_HD bool take(Vec3f contribution) {
    const float weight = luminance(contribution);
    if (!(weight > 0.0f) || !(weight < 1e30f)) return false;
    sum_ += weight;
    return rng_.uniform() * sum_ < weight;
  }

 private:
  Rng rng_;
  float sum_ = 0.0f;
};

// The far end as a left-hand-side point. Its mask was decided when the ray met it.
OCTRAD_HD_OR_HOST
template <typename World>
OCTRAD_HD inline ShadingPoint shade_far_end(const World& world, const FarEnd& end) {
  ShadingPoint point = world.shade(world.interact(end.hit, end.origin, end.direction), -end.direction);
  point.bsdf.opacity = 1.0f;
  point.bsdf.lobe = end.lobe;
  return point;
}

}  // namespace octrad
