// Left-hand-side points: where a radiance field is trained (method section 7, "LHS points").
#pragma once

#include <span>
#include <vector>

#include "geometry/surface_sampling.h"
#include "transport/context.h"

namespace octrad {

// Shares of the three kinds of points; the rest of 1 is area-uniform.
struct LhsOptions {
  double walks = 0.9;              // random walks from camera poses
  double view = 0.0;               // primary hits of the first camera
  double stop_probability = 0.3;   // of a walk at each vertex
  int max_walk = 16;
  double keep_direction = 0.0;     // share of walk vertices that keep the direction they were reached by as wo
  bool uniform_glossy = false;     // fresh directions of glossy points: uniform over the hemisphere instead of cosine
  double glossy_boost = 1.0;       // >= 1: how much likelier a glossy point is taken than a rough one
  float rough_threshold = 0.5f;    // alpha from which a point counts as rough
  int poses = 0;                   // drawn once, with the sensors among them; 0: a fresh one for every walk. Not with `cameras`
  unsigned long long seed = 0;
};

class LhsSampler {
 public:
  // `cameras`: poses that the user named; with the sensors they replace generated ones.
  LhsSampler(const TransportContext& context, const LhsOptions& options, const std::vector<Camera>& cameras = {});

  // `count` points of step `step`; masks decided, never black. Parallel; same bits at any thread count.
  void sample(unsigned long long step, std::span<ShadingPoint> points) const;

  const std::vector<Camera>& poses() const { return poses_; }

 private:
  bool walk_point(Rng& rng, ShadingPoint& point) const;
  bool view_point(Rng& rng, ShadingPoint& point) const;
  bool area_point(Rng& rng, ShadingPoint& point) const;
  bool free_ray(Rng& rng, Ray& ray) const;
  bool fresh_direction(Rng& rng, const SurfaceInteraction& surface, Vec3f n, ShadingPoint& point) const;

  TransportContext context_;
  LhsOptions options_;
  SurfaceSampler surfaces_;
  std::vector<Camera> poses_;      // the first is the scene's own view
  bool fresh_poses_ = false;
};

}  // namespace octrad
