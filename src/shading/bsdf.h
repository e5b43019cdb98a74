// Scattering at one surface point: dispatch over the models of shading/bsdf/list.h, wrappers, and the shaded hit.
// For the conventions of wo and wi see shading/bsdf_types.h. The models and wrappers behave as Mitsuba 3's.
#pragma once

#include <memory>
#include <vector>

#include "base/frame.h"
#include "geometry/tracer.h"
#include "scene/scene.h"
#include "shading/bsdf_types.h"

namespace octrad {

// f(wo, wi) |cos wi| without delta lobes, linear RGB. Zero below the surface for one-sided models.
Vec3f evaluate(const Bsdf& bsdf, Vec3f wo, Vec3f wi);
// Solid-angle density with which sample() draws wi, delta lobes excluded.
float pdf(const Bsdf& bsdf, Vec3f wo, Vec3f wi);
// Both of the above in one go.
BsdfValue evaluate_pdf(const Bsdf& bsdf, Vec3f wo, Vec3f wi);
// Draws wi. `u_lobe` picks the lobe, `u` the direction; all uniform in [0, 1). Invalid samples carry no light.
BsdfSample sample(const Bsdf& bsdf, Vec3f wo, float u_lobe, Vec2f u);

// Whether the model has only delta (or null) lobes: smooth conductor, dielectric, thin dielectric.
bool is_delta(const Bsdf& bsdf);
// First-hit attributes (method section 1): view-independent albedo, and roughness (1 for diffuse, 0 for smooth).
Vec3f albedo(const Bsdf& bsdf);
float roughness(const Bsdf& bsdf);

// A scene's materials prepared for shading: constant textures resolved, tables of plastics computed. Immutable; the scene
// and this object must outlive every Bsdf made from it.
class Materials {
 public:
  explicit Materials(const Scene& scene);
  ~Materials();
  // Parameters of material `index` (front side) at texture coordinates `uv`; bump mapping is applied by shade().
  Bsdf at(int index, Vec2f uv) const;
  void at(int index, Vec2f uv, Bsdf& out) const;
  // Starts loading the texels that at(index, uv) will read.
  void prefetch(int index, Vec2f uv) const;

  struct Record;
  const Record& record(int index) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

// A shaded hit: geometry, frame flipped to the side of wo on two-sided surfaces, bump applied, textures evaluated.
struct ShadingPoint {
  SurfaceInteraction surface;
  Vec3f ns, s, t;                  // shading frame in world space (left-handed where a two-sided surface was flipped)
  Vec3f wo;                        // world
  Bsdf bsdf;
  bool front = true;               // seen from the side of the geometric normal
  bool black = false;              // back of a one-sided opaque surface: scatters nothing
  Vec3f to_local(Vec3f v) const { return {dot(v, s), dot(v, t), dot(v, ns)}; }
  Vec3f to_world(Vec3f v) const { return s * v.x + t * v.y + ns * v.z; }
};

// `wo`: unit, world space, away from the surface. Sides are told by the shading normal, as Mitsuba does.
ShadingPoint shade(const Materials& materials, const SurfaceInteraction& surface, Vec3f wo);

}  // namespace octrad
