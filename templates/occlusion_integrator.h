// Ambient occlusion without a model. Template of docs/extending.md.
#pragma once

#include "octrad/render/integrator.h"
#include "octrad/transport/prepared_scene.h"

namespace octrad {

inline float occlusion_reach(const Scene& scene) { return 0.2f * length(scene.bounds.upper - scene.bounds.lower); }

// occlusion_integrator.cc
std::unique_ptr<Integrator> make_occlusion_integrator(const IntegratorInput& input);
// occlusion_integrator_device.cc
std::unique_ptr<DeviceIntegrator> make_device_occlusion_integrator(const IntegratorInput& input, Stream& stream,
                                                                   const DeviceWorld& world, DeviceField*,
                                                                   std::size_t capacity);
std::size_t device_occlusion_integrator_bytes(const IntegratorInput& input, std::size_t capacity);

}  // namespace octrad
