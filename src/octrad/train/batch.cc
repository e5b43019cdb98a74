#include "octrad/train/batch.h"

#include <algorithm>

#include "octrad/base/threads.h"
#include "octrad/transport/lobe_math.h"
#include "octrad/transport/query_point.h"

namespace octrad {

LhsOptions lhs_options(const Config& config) {
  LhsOptions options;
  options.walks = config.train_sampler == TrainSampler::area    ? 0.0
                  : config.train_sampler == TrainSampler::walks ? 1.0
                                                                : config.train_walks * (1.0 - config.train_view_share);
  options.view = config.train_view_share;
  options.stop_probability = config.train_stop_probability;
  options.max_walk = config.train_max_walk;
  options.keep_direction = config.train_keep_direction;
  options.uniform_glossy = config.train_fresh_direction == FreshDirection::uniform;
  options.glossy_boost = config.train_glossy_boost;
  options.rough_threshold = static_cast<float>(config.lookup_rough_threshold);
  options.follow_below = first_hit_rules(config).follow_below;
  options.split_coats = split_coats(config);
  options.poses = config.train_poses;
  options.seed = static_cast<unsigned long long>(config.seed);
  return options;
}

TraceCounts BatchSource::draw(unsigned long long stream, const ScheduleState& s, const RadianceQuery& query) {
  const auto n = static_cast<std::size_t>(s.points);
  shading_.resize(n);
  points_.resize(n);
  targets_.resize(n);
  const auto far_ends = static_cast<std::size_t>(s.far_ends);
  sampler_.sample(stream, shading_, std::span(far_ends_).first(std::min(far_ends, far_ends_.size())), s.by_area);
  if (changed_)
    changed_->replace(stream, std::span(shading_).last(static_cast<std::size_t>(changed_share_ * s.points)));
  RhsOptions rhs(rhs_rules(config_));
  rhs.directions = s.directions;
  rhs.rays = query_rays(config_);
  rhs.seed = static_cast<unsigned long long>(config_.seed);
  rhs.stream = stream;
  far_ends_.resize(query ? far_ends : 0);
  rhs.far_ends = far_ends_;
  rhs.guides = guides();
  rhs.learn_guides = true;
  rhs.epsilon = static_cast<float>(s.epsilon);
  const TraceCounts counts = estimate_rhs(context_, shading_, rhs, query, targets_);
  const QueryRays rays = query_rays(config_, true);
  parallel_blocks(n, 64, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      Rng rng = lobe_generator(rhs.seed, stream, i);
      points_[i] = field_query_point(context_, shading_[i], rays, rng);
      const SurfaceInteraction& surface = shading_[i].surface;
      if (rhs.emission_inside && surface.emitter >= 0) targets_[i] += context_.lights.emitted(surface, shading_[i].wo);
    }
  });
  return counts;
}

double mean_direct_light(BatchSource& batches, const Config& config) {
  ScheduleState s = schedule(config, 0, 0.0);
  s.points = std::min(config.train_points, 4096);
  std::vector<float> lit;
  long long count = 0;
  for (unsigned long long batch = 0; batch < 4; ++batch) {
    batches.draw((1ull << 62) + batch, s, nullptr);
    for (const Vec3f& t : batches.targets())
      if (const float value = luminance(t); value > 0.0f) lit.push_back(value);
    count += s.points;
  }
  if (lit.empty()) return 1.0;
  std::sort(lit.begin(), lit.end());
  const float limit = 100.0f * lit[lit.size() / 2];  // a few points beside a lamp do not decide
  double sum = 0.0;
  for (const float value : lit) sum += static_cast<double>(std::min(value, limit));
  return sum / static_cast<double>(count);
}

}  // namespace octrad
