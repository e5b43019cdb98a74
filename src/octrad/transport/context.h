// What light transport on the CPU needs: the scene, its tracer, materials and lights. The `World` of the templates in
// transport/*_math.h.
#pragma once

#include "octrad/geometry/shape_view.h"
#include "octrad/geometry/tracer.h"
#include "octrad/scene/scene.h"
#include "octrad/shading/lights.h"
#include "octrad/shading/materials.h"
#include "octrad/transport/follow_math.h"

namespace octrad {

struct TransportContext {
  static constexpr Models kModels = Models::all;
  using Surfaces = const TransportContext&;
  const Scene& scene;
  const Tracer& tracer;
  const Materials& materials;
  const Lights& lights;

  Hit intersect(Vec3f origin, Vec3f direction, float t_min, float t_max) const {
    return tracer.intersect(origin, direction, t_min, t_max);
  }
  bool occluded(Vec3f origin, Vec3f direction, float t_min, float t_max) const {
    return tracer.occluded(origin, direction, t_min, t_max);
  }
  SurfaceInteraction interact(const Hit& hit, Vec3f origin, Vec3f direction) const {
    return octrad::interact(shape_view(scene, static_cast<std::size_t>(hit.shape)), hit, origin, direction);
  }
  ShadingPoint shade(const SurfaceInteraction& surface, Vec3f wo) const {
    return octrad::shade<kModels>(materials.view(), surface, wo);
  }
  float opacity(const SurfaceInteraction& surface, Vec3f wo) const { return opacity_at(materials.view(), surface, wo); }
  LightSample sample_light(Vec3f x, float u_pick, Vec2f u) const {
    return octrad::sample_light(lights.view(), x, u_pick, u);
  }
  Vec3f emitted(const SurfaceInteraction& surface, Vec3f wo) const { return light_emitted(lights.view(), surface, wo); }
  float light_pdf(Vec3f x, const SurfaceInteraction& surface) const {
    return octrad::light_pdf(lights.view(), x, surface);
  }
  Vec3f environment(Vec3f direction) const { return light_environment(lights.view(), direction); }
  float environment_pdf(Vec3f x, Vec3f direction) const { return light_environment_pdf(lights.view(), x, direction); }
  Vec3f environment(Vec3f x, Vec3f direction, float& pdf) const {
    return light_environment(lights.view(), x, direction, pdf);
  }
  bool has_environment() const { return lights.has_environment(); }
  bool has_lights() const { return !lights.empty(); }
  bool hides_emitters() const { return scene.hide_emitters; }
};

}  // namespace octrad
