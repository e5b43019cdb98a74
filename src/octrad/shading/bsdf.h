// Scattering at one surface point: dispatch over the models of scene/material_types.h, wrappers, and the shaded hit.
// For the conventions of wo and wi see shading/bsdf_types.h. The models and wrappers behave as Mitsuba 3's.
#pragma once

#include <memory>
#include <vector>

#include "octrad/geometry/tracer.h"
#include "octrad/scene/scene.h"
#include "octrad/shading/bsdf_types.h"
#include "octrad/shading/materials_math.h"

namespace octrad {

// f(wo, wi) |cos wi| without delta lobes, linear RGB. Zero below the surface for one-sided models.
Vec3f evaluate(const Bsdf& bsdf, Vec3f wo, Vec3f wi);
// Solid-angle density with which sample() draws wi, delta lobes excluded.
float pdf(const Bsdf& bsdf, Vec3f wo, Vec3f wi);
// Both of the above, sharing work.
BsdfValue evaluate_pdf(const Bsdf& bsdf, Vec3f wo, Vec3f wi);
// Draws wi. `u_lobe` picks the lobe, `u` the direction; all uniform in [0, 1). Invalid samples carry no light.
BsdfSample sample(const Bsdf& bsdf, Vec3f wo, float u_lobe, Vec2f u);

// Whether the model has only delta (or null) lobes: smooth conductor, dielectric, thin dielectric.
bool is_delta(const Bsdf& bsdf);
// First-hit attributes (method section 1): view-independent albedo, and roughness (1 for diffuse, 0 for smooth).
Vec3f albedo(const Bsdf& bsdf);
float roughness(const Bsdf& bsdf);

// A scene's materials prepared for shading: constant textures resolved, tables of plastics computed. Immutable; the
// scene and this object must outlive every Bsdf made from it.
class Materials {
 public:
  explicit Materials(const Scene& scene);
  ~Materials();
  // Parameters of material `index` (front side) at texture coordinates `uv`; bump mapping is applied by shade().
  Bsdf at(int index, Vec2f uv) const;
  // Starts loading the texels that shade() will read.
  void prefetch(int index, Vec2f uv) const;
  // The tables as materials_math.h reads them: a record a material, a view a texture of the scene.
  const MaterialsView& view() const { return view_; }
  std::size_t size() const;
  std::size_t texture_count() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
  MaterialsView view_;
};

// `wo`: unit, world space, away from the surface. The side is decided by the shading normal, as in Mitsuba.
ShadingPoint shade(const Materials& materials, const SurfaceInteraction& surface, Vec3f wo);

}  // namespace octrad
