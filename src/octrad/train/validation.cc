#include "octrad/train/validation.h"

#include <algorithm>
#include <span>
#include <string>

#include "octrad/base/error.h"
#include "octrad/base/threads.h"
#include "octrad/transport/first_hit_math.h"
#include "octrad/transport/query_point.h"

namespace octrad {

struct Validation::Pixels {
  int width, height;  // of the reference
  std::vector<long long> places;
  std::vector<Vec3f> colors;

  // One pixel of each stride, at a random place in it: a stride that divides the width must not pick columns.
  Pixels(const Image& reference, int max_pixels) : width(reference.width), height(reference.height) {
    const Image rgb = extract_rgb(reference);
    const long long total = static_cast<long long>(width) * height;
    const long long stride = std::max<long long>(1, (total + max_pixels - 1) / max_pixels);
    for (long long p = 0; p < total; p += stride) {
      const unsigned long long random = mix64(static_cast<unsigned long long>(p) + 1);
      const long long chosen =
          std::min(total - 1, p + static_cast<long long>(random % static_cast<unsigned long long>(stride)));
      places.push_back(chosen);
      colors.push_back(rgb.rgb(static_cast<int>(chosen % width), static_cast<int>(chosen / width)));
    }
  }
};

Validation::Validation(const TransportContext& context, const Image& reference, const Config& config, int max_pixels,
                       int spp)
    : Validation(context, Pixels(reference, max_pixels), config, spp) {
  for (int i = 0; i < reference_.width; ++i) {
    if (is_finite(reference_.rgb(i, 0))) return;
  }
  throw InputError("the reference has no finite pixel among the " + std::to_string(reference_.width) +
                   " that are compared");
}

Validation::Validation(const TransportContext& context, const Pixels& pixels, const Config& config, int spp)
    : Validation(context, pixels, 0, pixels.places.size(), config, spp) {}

Validation::Validation(const TransportContext& context, const Pixels& pixels, std::size_t begin, std::size_t end,
                       const Config& config, int spp)
    : spp_(spp),
      reference_(static_cast<int>(end - begin), 1, {"R", "G", "B"}),
      known_(end - begin, Vec3f(0.0f)) {
  const FirstHitOptions options(first_hit_rules(config));
  const QueryRays rays = query_rays(config);
  const CameraView view = context.scene.cameras.front().view(pixels.width, pixels.height);
  struct Block {
    std::vector<SurfacePoint> points;
    std::vector<Owner> owners;
  };
  constexpr std::size_t kBlock = 64;
  std::vector<Block> blocks((end - begin + kBlock - 1) / kBlock);
  parallel_blocks(end - begin, kBlock, [&](std::size_t first_pixel, std::size_t last_pixel) {
    Block& block = blocks[first_pixel / kBlock];
    for (std::size_t i = first_pixel; i < last_pixel; ++i) {
      const long long place = pixels.places[begin + i];
      const auto x = static_cast<int>(place % pixels.width), y = static_cast<int>(place / pixels.width);
      Rng rng(static_cast<unsigned long long>(config.seed), RngPurpose::validation,
              static_cast<unsigned long long>(place));
      for (int s = 0; s < spp; ++s) {
        const Vec2f u = rng.uniform2();
        const Vec2f position{static_cast<float>(x) + u.x, static_cast<float>(y) + u.y};
        const Ray ray = sample_camera_ray(view, position, rng);
        CameraSample sample{ray, rng, position};
        RayEnd ray_end;
        FirstHit first;
        const FirstHitQuery query = trace_first_hit(context, options, sample, ray_end, first);
        rng = sample.rng;
        known_[i] += query.known;
        if (query.next != FirstHitQuery::Next::query) continue;
        for_each_asked_lobe(options, ray_end.point, [&] {
          block.points.push_back(field_query_point(context, ray_end.point, rays, rng));
          block.owners.push_back({i, ray_end.throughput});
        });
      }
    }
  });
  for (Block& block : blocks) {
    points_.insert(points_.end(), block.points.begin(), block.points.end());
    owners_.insert(owners_.end(), block.owners.begin(), block.owners.end());
    block = {};
  }
  for (std::size_t i = begin; i < end; ++i) reference_.set_rgb(static_cast<int>(i - begin), 0, pixels.colors[i]);
}

Metrics Validation::metrics(TrainEngine& engine) const {
  std::vector<Vec3f> predicted(points_.size());
  engine.radiance(points_, predicted);
  std::vector<Vec3f> sum = known_;
  for (std::size_t i = 0; i < points_.size(); ++i) sum[owners_[i].pixel] += owners_[i].weight * predicted[i];
  Image image = reference_;
  for (std::size_t i = 0; i < sum.size(); ++i) image.set_rgb(static_cast<int>(i), 0, sum[i] / static_cast<float>(spp_));
  return compare(reference_, image);
}

double Validation::mape(TrainEngine& engine) const { return metrics(engine).mape; }

double Validation::mape_once(const TransportContext& context, const Image& reference, const Config& config,
                             int max_pixels, int spp, TrainEngine& engine) {
  constexpr std::size_t kAtOnce = 16384;
  const Pixels pixels(reference, max_pixels);
  double sum = 0.0;
  long long counted = 0;
  for (std::size_t begin = 0; begin < pixels.places.size(); begin += kAtOnce) {
    const std::size_t end = std::min(pixels.places.size(), begin + kAtOnce);
    const std::span colors(pixels.colors.data() + begin, end - begin);
    if (std::none_of(colors.begin(), colors.end(), [](Vec3f color) { return is_finite(color); }))
      continue;  // compare() would find no pixel
    const Metrics m = Validation(context, pixels, begin, end, config, spp).metrics(engine);
    sum += m.mape * static_cast<double>(m.pixels);
    counted += m.pixels;
  }
  return counted > 0 ? sum / static_cast<double>(counted) : -1.0;
}

}  // namespace octrad
