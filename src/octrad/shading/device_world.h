// The `World` of kernels: everything that light transport needs of a scene, over plain pointers. Trivially copyable;
// made by DeviceScene (shading/device_scene.h). The functions are those that Tracer, Materials, Lights and
// SurfaceSampler call.
#pragma once

#include "octrad/geometry/bvh8_math.h"
#include "octrad/geometry/surface_sampling_math.h"
#include "octrad/shading/lights_math.h"
#include "octrad/shading/materials_math.h"

namespace octrad {

// The part of it that rays meet: few numbers, so that a function that is not inlined takes it as a value.
struct DeviceSurfaces {
  static constexpr Models kModels = Models::all;
  Bvh8View bvh{};
  const ShapeView* shapes = nullptr;
  MaterialsView materials;

  // The nearest surface between t_min and t_max, and whether there is one.
  OCTRAD_HD Hit intersect(Vec3f origin, Vec3f direction, float t_min, float t_max) const {
    return bvh8_intersect(bvh, origin, direction, t_min, t_max);
  }
  OCTRAD_HD bool occluded(Vec3f origin, Vec3f direction, float t_min, float t_max) const {
    return bvh8_occluded(bvh, origin, direction, t_min, t_max);
  }
  // The surface at a valid hit.
  OCTRAD_HD SurfaceInteraction interact(const Hit& hit, Vec3f origin, Vec3f direction) const {
    return octrad::interact(shapes[hit.shape], hit, origin, direction);
  }
  OCTRAD_HD ShadingPoint shade(const SurfaceInteraction& surface, Vec3f wo) const {
    return octrad::shade<kModels>(materials, surface, wo);
  }
  OCTRAD_HD float opacity(const SurfaceInteraction& surface, Vec3f wo) const {
    return opacity_at(materials, surface, wo);
  }
};

struct DeviceWorld : DeviceSurfaces {
  using Surfaces = DeviceSurfaces;
  LightsView lights;
  bool plain = false;  // PlainDeviceWorld will do
  bool hidden_emitters = false;
  SurfaceSamplerView surfaces;  // without elements where DeviceScene was given no sampler

  OCTRAD_HD LightSample sample_light(Vec3f x, float u_pick, Vec2f u) const {
    return octrad::sample_light(lights, x, u_pick, u);
  }
  OCTRAD_HD Vec3f emitted(const SurfaceInteraction& surface, Vec3f wo) const {
    return light_emitted(lights, surface, wo);
  }
  OCTRAD_HD float light_pdf(Vec3f x, const SurfaceInteraction& surface) const {
    return octrad::light_pdf(lights, x, surface);
  }
  OCTRAD_HD Vec3f environment(Vec3f direction) const { return light_environment(lights, direction); }
  OCTRAD_HD float environment_pdf(Vec3f x, Vec3f direction) const {
    return light_environment_pdf(lights, x, direction);
  }
  OCTRAD_HD Vec3f environment(Vec3f x, Vec3f direction, float& pdf) const {
    return light_environment(lights, x, direction, pdf);
  }
  OCTRAD_HD bool has_environment() const { return lights.has_environment(); }
  OCTRAD_HD bool has_lights() const { return lights.count > 0; }
  OCTRAD_HD bool hides_emitters() const { return hidden_emitters; }

  // Uniform in area; numbers in [0, 1). Needs a sampler.
  OCTRAD_HD SurfaceInteraction sample_surface(float u_pick, Vec2f u) const {
    return octrad::sample_surface(surfaces, u_pick, u);
  }
};

// A world without extended models: kernels of it have no code for them, which would take their registers.
struct PlainDeviceWorld : DeviceWorld {
  static constexpr Models kModels = Models::plain;
  explicit PlainDeviceWorld(const DeviceWorld& world) : DeviceWorld(world) {}
  OCTRAD_HD ShadingPoint shade(const SurfaceInteraction& surface, Vec3f wo) const {
    return octrad::shade<kModels>(materials, surface, wo);
  }
};

// Calls run(world) with the world as the type that it needs.
template <typename Run>
void with_world(const DeviceWorld& world, const Run& run) {
  if (world.plain) run(PlainDeviceWorld(world));
  else run(world);
}

}  // namespace octrad
