// Light sampling at a surface, for host and device.
#pragma once

#include "octrad/base/sobol_math.h"
#include "octrad/shading/bsdf_math.h"
#include "octrad/shading/light_sample.h"
#include "octrad/shading/shading_point.h"
#include "octrad/transport/direction_guide_math.h"
#include "octrad/transport/masked_light_math.h"

namespace octrad {

// Direct light by emitter sampling, balance heuristic against BSDF sampling, or against what guide and BSDF draw
// together: the contribution if the shadow ray is unoccluded.
struct EmitterSample {
  bool valid = false;
  RayQuery ray;
  Vec3f contribution{0, 0, 0};
};

OCTRAD_HD_OR_HOST
template <typename World>
OCTRAD_HD inline EmitterSample sample_emitter(const World& world, const ShadingPoint& point, Vec3f wo,
                                              const SobolSet::Sample& u, const Guide& guide = {}) {
  EmitterSample sample;
  const LightSample light = world.sample_light(point.surface.position, u.u1, u.u2);
  if (!light.valid || light.pdf <= 0.0f) return sample;
  const Vec3f wi = point.to_local(light.direction);
  const BsdfValue f = evaluate_bsdf<World::kModels>(point.bsdf, wo, wi);
  if (max_component(f.value) <= 0.0f) return sample;
  sample.ray = shadow_ray(point.surface.position, point.surface.geometric_normal, light);
  const float left = left_by_masks(world, light, sample.ray);
  sample.valid = left > 0.0f;
  sample.contribution =
      f.value * light.radiance * (left / light_mis_density(light, guide.density(light.direction, f.pdf)));
  return sample;
}

}  // namespace octrad
