#include "octrad/render/path_integrator.h"

#include <vector>

namespace octrad {

RenderResult render_path(const TransportContext& context, const RenderOptions& options) {
  const PathLimits limits{options.max_depth, options.rr_depth};
  return render(options, [&](std::span<CameraSample> samples, std::span<PixelSample> out) {
    std::vector<PathSample> paths;
    paths.reserve(samples.size());
    for (const CameraSample& s : samples) paths.push_back({s.ray, s.rng, {}, {}});
    PathCounters path;
    trace_paths(context, limits, paths, path);
    for (std::size_t i = 0; i < paths.size(); ++i) {
      const FirstHit& first = paths[i].first;
      out[i] = {paths[i].radiance, first.albedo, first.normal, first.depth, first.roughness};
    }
    SampleCounts counts;
    counts.rays = path.rays;
    return counts;
  });
}

}  // namespace octrad
