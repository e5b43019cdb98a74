// One training batch: left-hand-side points and their targets by the rendering equation (method section 7).
#pragma once

#include <memory>
#include <utility>
#include <vector>

#include "octrad/model/config.h"
#include "octrad/train/changed_points.h"
#include "octrad/train/schedule.h"
#include "octrad/transport/direction_guide.h"
#include "octrad/transport/lhs_sampler.h"
#include "octrad/transport/rhs_estimator.h"

namespace octrad {

LhsOptions lhs_options(const Config& config);

class BatchSource {
 public:
  BatchSource(const PreparedScene& scene, const Config& config, const std::vector<Camera>& cameras)
      : context_(scene.context()),
        config_(config),
        sampler_(scene, lhs_options(config), cameras) {}

  // Draws s.points points from the random numbers of `stream` (the step) and estimates their targets, querying `query`
  // where the bounce ends. Replaces points() and targets().
  TraceCounts draw(unsigned long long stream, const ScheduleState& s, const RadianceQuery& query);
  const LhsSampler& sampler() const { return sampler_; }
  // From now on a share of the points is of `changed`; null: none.
  void set_changed(std::unique_ptr<ChangedPoints> changed, double share) {
    changed_ = std::move(changed);
    changed_share_ = share;
  }
  // Points of the next batch that the last one chose. Part of the state of a run (TrainEngine::far_ends).
  std::vector<FarEnd>& far_ends() { return far_ends_; }
  // What directions are drawn by besides the BSDF; draws with a query add to it. Empty: nothing.
  GuideState& guide() { return guide_; }
  void make_guide_tables() { octrad::make_guide_tables(guides()); }
  const std::vector<SurfacePoint>& points() const { return points_; }
  const std::vector<Vec3f>& targets() const { return targets_; }

 private:
  GuideView guides() { return guide_.view(static_cast<float>(config_.train_guide)); }

  TransportContext context_;
  const Config& config_;
  LhsSampler sampler_;
  std::unique_ptr<ChangedPoints> changed_;
  double changed_share_ = 0.0;
  std::vector<ShadingPoint> shading_;
  std::vector<SurfacePoint> points_;
  std::vector<Vec3f> targets_;
  std::vector<FarEnd> far_ends_;  // of the last batch
  GuideState guide_;
};

// Mean luminance of direct light over a few batches (above 0): a scale with which a network's outputs start near 1.
double mean_direct_light(BatchSource& batches, const Config& config);

}  // namespace octrad
