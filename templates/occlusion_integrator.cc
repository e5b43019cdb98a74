#include "octrad/render/occlusion_integrator.h"

#include "octrad/render/integrators.h"
#include "octrad/render/occlusion_math.h"

namespace octrad {
namespace {

class OcclusionIntegrator : public Integrator {
 public:
  explicit OcclusionIntegrator(const IntegratorInput& input)
      : context_(input.scene.context()),
        reach_(occlusion_reach(input.scene.scene())) {}

  SampleCounts sample(std::span<CameraSample> samples, std::span<PixelSample> out) override {
    for (std::size_t i = 0; i < samples.size(); ++i) {
      FirstHit first;
      const Vec3f seen = occlusion(context_, samples[i], reach_, first);
      out[i] = pixel_sample(seen, first);
    }
    SampleCounts counts;
    counts.rays = 2 * static_cast<long long>(samples.size());
    return counts;
  }

 private:
  const TransportContext context_;
  const float reach_;
};

}  // namespace

std::unique_ptr<Integrator> make_occlusion_integrator(const IntegratorInput& input) {
  return std::make_unique<OcclusionIntegrator>(input);
}

}  // namespace octrad
