// Left-hand-side points where a change of the scene matters most: on what changed, and on what that lights.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "octrad/transport/lhs_math.h"
#include "octrad/transport/prepared_scene.h"

namespace octrad {

class ChangedPoints {
 public:
  // The scene must outlive this object.
  ChangedPoints(const PreparedScene& scene, const LhsOptions& options, const SceneChange& change);

  // Whether there are none: a change is everywhere alike (an environment, a directional light).
  bool empty() const { return !surfaces_ && lights_.empty(); }

  // Replaces some of `points`, those of step `step`: half of them by points uniform in area over the changed shapes,
  // half by ends of rays that leave those shapes with a cosine density, or the lights without extent uniformly; all of
  // them seen from a fresh direction. Where such a ray meets nothing, or a black side, the point stays. Parallel; the
  // same bits at any thread count.
  void replace(unsigned long long step, std::span<ShadingPoint> points) const;

 private:
  bool draw(Rng& rng, ShadingPoint& point) const;
  bool look_at(const SurfaceInteraction& surface, Vec3f side, Rng& rng, ShadingPoint& point) const;

  TransportContext context_;
  LhsOptions options_;
  std::unique_ptr<SurfaceSampler> surfaces_;  // of the changed shapes; null: none
  std::vector<Vec3f> lights_;
};

}  // namespace octrad
