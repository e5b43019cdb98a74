// Points uniform in area over all surfaces of a scene.
#pragma once

#include <vector>

#include "geometry/tracer.h"

namespace octrad {

class SurfaceSampler {
 public:
  // Throws InputError for a scene without area. The scene must outlive the sampler.
  explicit SurfaceSampler(const Scene& scene);

  // u_pick and u in [0, 1): which triangle or sphere, and where on it. SurfaceInteraction::t is 0.
  SurfaceInteraction sample(float u_pick, Vec2f u) const;
  double total_area() const { return total_area_; }        // square world units

 private:
  struct Element { int shape, primitive; };
  const Scene& scene_;
  std::vector<Element> elements_;
  std::vector<double> cumulative_;   // area up to and including each element
  double total_area_ = 0.0;
};

}  // namespace octrad
