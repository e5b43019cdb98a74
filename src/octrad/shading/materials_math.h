// From a point of a surface to a shaded hit: parameters looked up in textures, sides, bump mapping. For host and
// device, over the tables that Materials makes (shading/materials.h).
#pragma once

#include <cmath>
#include <cstdint>

#include "octrad/base/frame.h"
#include "octrad/scene/texture_math.h"
#include "octrad/shading/bsdf_math.h"
#include "octrad/shading/shading_point.h"

namespace octrad {

// What a texture may drive: the parameters of OCTRAD_MATERIAL_SLOTS, and the opacity of a mask.
struct MaterialSlot {
#define OCTRAD_NAME(name) name,
  enum : int { OCTRAD_MATERIAL_SLOTS(OCTRAD_NAME) opacity, count };
#undef OCTRAD_NAME
};
inline constexpr int kMaterialSlots = MaterialSlot::count;

struct MaterialRecord {
  Bsdf constant;                      // every parameter that does not vary over the surface
  std::uint32_t textured = 0;         // bit s: slot s does
  int textures[kMaterialSlots] = {};  // of those slots
  int bump = -1;                      // texture
  float bump_scale = 1.0f;
  int back = -1;  // record of the other side
};

struct MaterialsView {
  const MaterialRecord* records = nullptr;
  const TextureView* textures = nullptr;
};

OCTRAD_HD inline void assign(Vec3f& parameter, Vec3f value) { parameter = value; }
OCTRAD_HD inline void assign(float& parameter, Vec3f value) { parameter = value.x; }
OCTRAD_HD inline void assign_slot(Bsdf& b, int slot, Vec3f value) {
  switch (slot) {
#define OCTRAD_CASE(name) \
  case MaterialSlot::name: assign(b.name, value); break;
    OCTRAD_MATERIAL_SLOTS(OCTRAD_CASE)
#undef OCTRAD_CASE
    default: b.opacity = value.x < 0.0f ? 0.0f : (value.x > 1.0f ? 1.0f : value.x); break;
  }
}

// Parameters of one side of a material; bump mapping is applied by shade().
OCTRAD_HD inline void material_at(const MaterialsView& view, const MaterialRecord& record, Vec2f uv, Bsdf& b) {
  b = record.constant;
  if (record.textured == 0) return;
#if defined(__CUDA_ARCH__)
#pragma unroll 1
#endif
  for (int slot = 0; slot < kMaterialSlots; ++slot) {
    if (record.textured >> slot & 1u) assign_slot(b, slot, evaluate_texture(view.textures[record.textures[slot]], uv));
  }
}

// Mitsuba's `bumpmap`: displaces the surface along its shading normal and takes the normal of the result.
OCTRAD_HD inline Vec3f bumped_normal(const TextureView& texture, float scale, const SurfaceInteraction& surface) {
  const Vec3f n = surface.shading_normal;
  const Vec2f g = texture_gradient(texture, surface.uv) * scale;
  const Vec3f du = surface.dp_du + n * (g.x - dot(n, surface.dp_du));
  const Vec3f dv = surface.dp_dv + n * (g.y - dot(n, surface.dp_dv));
  const Vec3f c = cross(du, dv);
  const float l = length(c);
  if (!(l > 0.0f)) return n;
  const Vec3f m = c / l;
  return dot(surface.geometric_normal, m) < 0.0f ? -m : m;
}

// `wo`: unit, world space, away from the surface. The side is decided by the shading normal, as in Mitsuba.
OCTRAD_HD inline ShadingPoint shade(const MaterialsView& materials, const SurfaceInteraction& surface, Vec3f wo) {
  ShadingPoint p;
  p.surface = surface;
  p.wo = wo;
  p.front = dot(wo, surface.geometric_normal) > 0.0f;
  const MaterialRecord* record = &materials.records[surface.material];
  Vec3f n = surface.shading_normal;
  const bool two_sided = record->constant.two_sided;
  if (two_sided && record->back >= 0 && dot(wo, n) < 0.0f) record = &materials.records[record->back];
  material_at(materials, *record, surface.uv, p.bsdf);
  p.bsdf.two_sided = two_sided;
  if (record->bump >= 0) n = bumped_normal(materials.textures[record->bump], record->bump_scale, surface);
  const Vec3f s = surface.dp_du - n * dot(n, surface.dp_du);
  const float l2 = dot(s, s);
  if (l2 > 1e-24f && std::isfinite(l2)) {
    p.s = s / std::sqrt(l2);
    p.t = cross(n, p.s);
  } else {
    const Frame frame = make_frame(n);
    p.s = frame.s;
    p.t = frame.t;
  }
  const float side = dot(wo, n);
  p.ns = two_sided && side < 0.0f ? -n : n;
  if (record->bump >= 0) {
    p.bsdf.bumped = true;
    p.bsdf.base_normal = p.to_local(two_sided && side < 0.0f ? -surface.shading_normal : surface.shading_normal);
  }
  p.black = !two_sided && side <= 0.0f && p.bsdf.opacity >= 1.0f && !transmits(p.bsdf.type);
  return p;
}

}  // namespace octrad
