#include "octrad/train/validation.h"

#include <algorithm>

#include "octrad/image/metrics.h"
#include "octrad/transport/first_hit_math.h"
#include "octrad/transport/query_point.h"

namespace octrad {

Validation::Validation(const TransportContext& context, const Image& reference, const Config& config, int max_pixels,
                       int spp)
    : spp_(spp) {
  const Image colors = extract_rgb(reference);
  const Camera& camera = context.scene.cameras.front();
  const FirstHitOptions options(first_hit_rules(config));
  const QueryRays rays = query_rays(config);
  const CameraView view = camera.view(reference.width, reference.height);
  std::vector<Vec3f> chosen_colors;
  const long long total = static_cast<long long>(reference.width) * reference.height;
  const long long stride = std::max<long long>(1, (total + max_pixels - 1) / max_pixels);
  for (long long p = 0; p < total; p += stride) {
    // One pixel of each stride, at a random place in it: a stride that divides the width must not pick columns.
    const unsigned long long random = mix64(static_cast<unsigned long long>(p) + 1);
    const long long chosen =
        std::min(total - 1, p + static_cast<long long>(random % static_cast<unsigned long long>(stride)));
    const int x = static_cast<int>(chosen % reference.width), y = static_cast<int>(chosen / reference.width);
    chosen_colors.push_back(colors.rgb(x, y));
    Vec3f known(0.0f);
    Rng rng(static_cast<unsigned long long>(config.seed), RngPurpose::validation, static_cast<unsigned long long>(p));
    for (int s = 0; s < spp; ++s) {
      const Vec2f u = rng.uniform2();
      const Vec2f position{static_cast<float>(x) + u.x, static_cast<float>(y) + u.y};
      const Ray ray = sample_camera_ray(view, position, rng);
      CameraSample sample{ray, rng, position};
      RayEnd end;
      FirstHit first;
      const FirstHitQuery query = trace_first_hit(context, options, sample, end, first);
      rng = sample.rng;
      known += query.known;
      if (query.next != FirstHitQuery::Next::query) continue;
      for_each_asked_lobe(options, end.point, [&] {
        points_.push_back(field_query_point(context, end.point, rays, rng));
        owners_.push_back({known_.size(), end.throughput});
      });
    }
    known_.push_back(known);
  }
  reference_ = Image(static_cast<int>(chosen_colors.size()), 1, {"R", "G", "B"});
  for (std::size_t i = 0; i < chosen_colors.size(); ++i) reference_.set_rgb(static_cast<int>(i), 0, chosen_colors[i]);
}

double Validation::mape(TrainEngine& engine) const {
  std::vector<Vec3f> predicted(points_.size());
  engine.radiance(points_, predicted);
  std::vector<Vec3f> sum = known_;
  for (std::size_t i = 0; i < points_.size(); ++i) sum[owners_[i].pixel] += owners_[i].weight * predicted[i];
  Image image = reference_;
  for (std::size_t i = 0; i < sum.size(); ++i) image.set_rgb(static_cast<int>(i), 0, sum[i] / static_cast<float>(spp_));
  return compare(reference_, image).mape;
}

}  // namespace octrad
