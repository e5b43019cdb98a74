#include "octrad/train/validation.h"

#include <algorithm>
#include <cmath>

#include "octrad/base/error.h"
#include "octrad/transport/rhs_estimator.h"

namespace octrad {

Validation::Validation(const TransportContext& context, const Image& reference, const Config& config, int max_pixels,
                       int spp)
    : spp_(spp) {
  const int r = reference.channel("R");
  if (r < 0 || reference.channel("G") != r + 1 || reference.channel("B") != r + 2)
    throw InputError("the reference has no R,G,B channels");
  const Camera& camera = context.scene.cameras.front();
  const long long total = static_cast<long long>(reference.width) * reference.height;
  const long long stride = std::max<long long>(1, (total + max_pixels - 1) / max_pixels);
  for (long long p = 0; p < total; p += stride) {
    // One pixel of each stride, at a random place in it: a stride that divides the width must not pick columns.
    const long long chosen =
        std::min(total - 1, p + static_cast<long long>(mix64(static_cast<unsigned long long>(p) + 1) %
                                                       static_cast<unsigned long long>(stride)));
    const int x = static_cast<int>(chosen % reference.width), y = static_cast<int>(chosen / reference.width);
    Pixel pixel{reference.rgb(x, y, r), Vec3f(0.0f)};
    Rng rng(static_cast<unsigned long long>(config.seed), RngPurpose::validation, static_cast<unsigned long long>(p));
    for (int s = 0; s < spp; ++s) {
      const Vec2f u = rng.uniform2();
      const Ray ray = camera.generate({static_cast<float>(x) + u.x, static_cast<float>(y) + u.y}, reference.width,
                                      reference.height);
      const RayEnd end =
          follow_ray(context, ray.origin, nullptr, ray.direction, rng, false, config.train_max_chain, ray.t_max);
      const bool outside = config.target_emission == TargetEmission::outside || !end.surface;
      pixel.known += outside ? end.first_emitted + end.emitted : end.passed_emitted;  // the rest is in the prediction
      if (!end.surface) continue;
      SurfacePoint point = surface_point(end.point);
      if (config.lookup_offset == LookupOffset::traced)
        point.disparity = traced_disparity(context, point, end.point.surface.geometric_normal);
      points_.push_back(point);
      owner_.push_back(pixels_.size());
    }
    pixels_.push_back(pixel);
  }
}

double Validation::mape(TrainEngine& engine) const {
  std::vector<Vec3f> predicted(points_.size());
  engine.radiance(points_, predicted);
  std::vector<Vec3f> sum(pixels_.size());
  for (std::size_t i = 0; i < pixels_.size(); ++i) sum[i] = pixels_[i].known;
  for (std::size_t i = 0; i < points_.size(); ++i) sum[owner_[i]] += predicted[i];
  double error = 0.0;
  for (std::size_t i = 0; i < pixels_.size(); ++i) {
    for (int c = 0; c < 3; ++c) {
      const float reference = pixels_[i].reference[c];
      error += std::abs(sum[i][c] / static_cast<float>(spp_) - reference) / (reference + 0.01f);
    }
  }
  return error / (3.0 * static_cast<double>(std::max<std::size_t>(1, pixels_.size())));
}

}  // namespace octrad
