// Points uniform in area over all surfaces of a scene.
#pragma once

#include <cstdint>
#include <vector>

#include "geometry/tracer.h"

namespace octrad {

class SurfaceSampler {
 public:
  // Throws InputError for a scene without area. The scene must outlive the sampler.
  explicit SurfaceSampler(const Scene& scene);

  // u_pick and u in [0, 1): which triangle or sphere, and where on it. SurfaceInteraction::t is 0.
  SurfaceInteraction sample(float u_pick, Vec2f u) const;
  // Only where that point lies; several times as fast.
  Vec3f sample_position(float u_pick, Vec2f u) const;
  double total_area() const { return total_area_; }        // square world units

 private:
  struct Element { int shape, primitive; };
  Element pick(float u_pick) const;

  const Scene& scene_;
  std::vector<Element> elements_;
  std::vector<double> cumulative_;   // area up to and including each element
  std::vector<std::uint32_t> guide_; // first element whose share ends after i / size (Chen & Asau 1974)
  double total_area_ = 0.0;
};

}  // namespace octrad
