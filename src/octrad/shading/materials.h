// The materials of a scene on the CPU, and the shaded hit.
#pragma once

#include <memory>
#include <optional>

#include "octrad/scene/scene.h"
#include "octrad/shading/bsdf_types.h"
#include "octrad/shading/materials_math.h"

namespace octrad {

// What replaces parameters of a material all over it; those that are absent are the scene's.
struct MaterialEdit {
  std::optional<Vec3f> color;      // the parameter of color_slot()
  std::optional<float> roughness;  // alpha, of principled models their `roughness`
  bool operator==(const MaterialEdit&) const = default;
};

// A scene's materials prepared for shading: constant textures resolved, tables of plastics computed. The scene and this
// object must outlive every Bsdf made from it.
class Materials {
 public:
  explicit Materials(const Scene& scene);
  ~Materials();
  // Parameters of material `index` (front side) at texture coordinates `uv`; bump mapping is applied by shade().
  Bsdf at(int index, Vec2f uv) const;
  // Applies an edit instead of the one before. Not while anything else uses this object; Bsdfs made before are invalid.
  void set_edit(int index, const MaterialEdit& edit);
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

// MaterialSlot that is a model's colour, -1: none. And whether its roughness can be set.
int color_slot(BsdfType type);
bool has_roughness(BsdfType type);

// `wo`: unit, world space, away from the surface. The side is decided by the shading normal, as in Mitsuba.
ShadingPoint shade(const Materials& materials, const SurfaceInteraction& surface, Vec3f wo);

}  // namespace octrad
