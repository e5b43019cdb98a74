#include "render/path_integrator.h"

namespace octrad {

RenderResult render_path(const TransportContext& context, const RenderOptions& options) {
  const PathLimits limits{options.max_depth, options.rr_depth};
  return render(options, [&](std::span<CameraSample> samples, std::span<PixelSample> out) {
    PathCounters path;
    for (std::size_t i = 0; i < samples.size(); ++i) {
      CameraSample& s = samples[i];
      FirstHit first;
      const Vec3f radiance = trace_path(context, s.ray, limits, s.rng, first, path);
      out[i] = {radiance, first.albedo, first.normal, first.depth, first.roughness};
    }
    SampleCounts counts;
    counts.rays = path.rays;
    return counts;
  });
}

}  // namespace octrad
