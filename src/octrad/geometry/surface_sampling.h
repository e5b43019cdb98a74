// Points uniform in area over all surfaces of a scene; in an instance that stretches a mesh, uniform before it does.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "octrad/geometry/surface_sampling_math.h"
#include "octrad/scene/scene.h"

namespace octrad {

class SurfaceSampler {
 public:
  // Samples all shapes, or those of these indices (none: all). Throws InputError where they have no area. The scene
  // must outlive the sampler.
  explicit SurfaceSampler(const Scene& scene, std::span<const int> shapes = {});

  SurfaceSampler(const SurfaceSampler&) = delete;
  SurfaceSampler& operator=(const SurfaceSampler&) = delete;

  // u_pick and u in [0, 1): which triangle or sphere, and where on it. SurfaceInteraction::t is 0.
  SurfaceInteraction sample(float u_pick, Vec2f u) const;
  // Only where that point lies; several times as fast.
  Vec3f sample_position(float u_pick, Vec2f u) const;
  // The tables as surface_sampling_math.h reads them.
  const SurfaceSamplerView& view() const { return view_; }

 private:
  std::vector<SurfaceElement> elements_;
  std::vector<double> cumulative_;
  std::vector<std::uint32_t> guide_;
  std::vector<ShapeView> shapes_;
  std::vector<std::vector<CdfEntry>> placed_areas_;
  std::vector<PlacedMesh> placed_;
  SurfaceSamplerView view_;
};

}  // namespace octrad
