// Left-hand-side points: where a radiance field is trained (method section 7).
#pragma once

#include <span>
#include <string>
#include <vector>

#include "octrad/transport/far_ends_math.h"
#include "octrad/transport/lhs_math.h"
#include "octrad/transport/prepared_scene.h"

namespace octrad {

class LhsSampler {
 public:
  // `cameras`: poses that the user named; with the sensors they replace generated ones. The scene must outlive the
  // sampler.
  LhsSampler(const PreparedScene& scene, const LhsOptions& options, const std::vector<Camera>& cameras = {});

  // The points of step `step`; masks decided, never black. Point i is far_ends[i] where that is valid, and drawn
  // otherwise. Of the points by area the share `by_area` is, the others are walks. Parallel; same bits at any thread
  // count.
  void sample(unsigned long long step, std::span<ShadingPoint> points, std::span<const FarEnd> far_ends = {},
              double by_area = 1.0) const;

  const std::vector<Camera>& poses() const { return poses_; }
  // The poses as lhs_point() takes them, and whether every walk starts from a fresh pose instead.
  std::span<const CameraView> views() const { return views_; }
  bool fresh_poses() const { return fresh_poses_; }

 private:
  TransportContext context_;
  LhsOptions options_;
  const SurfaceSampler& surfaces_;
  std::vector<Camera> poses_;      // the first is the scene's own view
  std::vector<CameraView> views_;  // of the poses
  bool fresh_poses_ = false;
};

// Why a point cannot be drawn.
std::string no_lhs_point();

}  // namespace octrad
