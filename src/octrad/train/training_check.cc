#include <cmath>

#include "octrad/base/rng.h"
#include "octrad/train/checks.h"
#include "octrad/transport/query_point.h"

namespace octrad {

std::vector<SurfacePoint> surface_probes(const PreparedScene& scene, std::size_t n, std::uint64_t seed,
                                         const Config& config) {
  const TransportContext context = scene.context();
  const QueryRays rays = query_rays(config);
  std::vector<SurfacePoint> points(n);
  for (std::size_t i = 0; i < n; ++i) {
    Rng rng(seed, RngPurpose::test, i);
    const float pick = rng.uniform();
    const SurfaceInteraction surface = scene.surfaces().sample(pick, rng.uniform2());
    Vec3f wo = uniform_direction(rng.uniform2());
    if (dot(wo, surface.geometric_normal) < 0.0f) wo = -wo;
    points[i] = field_query_point(context, context.shade(surface, wo), rays, rng);
  }
  return points;
}

double mean_difference(const RadianceField& a, const RadianceField& b, std::span<const SurfacePoint> points) {
  std::vector<Vec3f> of_a(points.size()), of_b(points.size());
  a.radiance(points, of_a);
  b.radiance(points, of_b);
  double sum = 0.0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const double x = static_cast<double>(luminance(of_a[i])), y = static_cast<double>(luminance(of_b[i]));
    sum += std::fabs(x - y) / (0.5 * (std::fabs(x) + std::fabs(y)) + 0.01);
  }
  return sum / static_cast<double>(points.size());
}

TrainingPair train_on_both(Stream& stream, const PreparedScene& scene, const Config& config,
                           std::span<const SurfacePoint> probes) {
  TrainOptions options;
  TrainingPair pair;
  pair.on_cpu = train(scene, config, options);
  options.stream = &stream;
  pair.on_stream = train(scene, config, options);
  pair.loss_difference = std::fabs(pair.on_stream.loss - pair.on_cpu.loss) / pair.on_cpu.loss;
  pair.difference = mean_difference(*pair.on_stream.field, *pair.on_cpu.field, probes);
  return pair;
}

}  // namespace octrad
