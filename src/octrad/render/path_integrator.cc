// Path tracing (transport/path.h).
#include <vector>

#include "octrad/render/integrators.h"
#include "octrad/transport/path.h"
#include "octrad/transport/prepared_scene.h"

namespace octrad {
namespace {

class PathIntegrator : public Integrator {
 public:
  explicit PathIntegrator(const IntegratorInput& input)
      : context_(input.scene.context()),
        limits_{input.max_depth, input.rr_depth} {}

  SampleCounts sample(std::span<CameraSample> samples, std::span<PixelSample> out) override {
    std::vector<PathSample> paths;
    paths.reserve(samples.size());
    for (const CameraSample& s : samples) paths.push_back({s.ray, s.rng, {}, {}});
    PathCounters path;
    trace_paths(context_, limits_, paths, path);
    for (std::size_t i = 0; i < paths.size(); ++i) out[i] = pixel_sample(paths[i].radiance, paths[i].first);
    SampleCounts counts;
    counts.rays = path.rays;
    return counts;
  }

 private:
  const TransportContext context_;
  const PathLimits limits_;
};

}  // namespace

std::unique_ptr<Integrator> make_path_integrator(const IntegratorInput& input) {
  return std::make_unique<PathIntegrator>(input);
}

}  // namespace octrad
