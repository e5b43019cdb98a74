// From a point of a surface to a shaded hit: parameters looked up in textures, sides, bump mapping. For host and
// device, over the tables that Materials makes (shading/materials.h).
#pragma once

#include <cmath>
#include <cstdint>

#include "octrad/base/frame.h"
#include "octrad/shading/bsdf_math.h"
#include "octrad/shading/shading_point.h"

namespace octrad {

// Parameters of one side of a material; bump mapping is applied by shade(). Models::plain: no
// material of the scene is of an extended model.
template <Models kModels = Models::all>
OCTRAD_HD inline void material_at(const MaterialsView& view, const MaterialRecord& record, Vec2f uv, Bsdf& b) {
  parameters_at(view.textures, record, uv, b);
  if constexpr (kModels == Models::all) {
    if (record.masked_parts) b.opacity *= blend_opacity(record, uv);
  }
}

// The record of the side that is seen. `wo` as for shade().
OCTRAD_HD inline const MaterialRecord& seen_record(const MaterialsView& materials, const SurfaceInteraction& surface,
                                                   Vec3f wo) {
  const MaterialRecord& record = materials.records[surface.material];
  const bool back = record.constant.two_sided && record.back >= 0 && dot(wo, surface.shading_normal) < 0.0f;
  return back ? materials.records[record.back] : record;
}

// Bsdf::opacity of the point that shade() makes, without the rest of it.
OCTRAD_HD inline float opacity_at(const MaterialsView& materials, const SurfaceInteraction& surface, Vec3f wo) {
  const MaterialRecord& record = seen_record(materials, surface, wo);
  Bsdf b;
  b.opacity = record.constant.opacity;
  if (record.textured >> MaterialSlot::opacity & 1u)
    assign_slot(b, MaterialSlot::opacity,
                evaluate_texture(materials.textures[record.textures[MaterialSlot::opacity]], surface.uv));
  return record.masked_parts ? b.opacity * blend_opacity(record, surface.uv) : b.opacity;
}

// The surface's normal after its bump or normal map, in world space. `frame`: around its shading normal, along dp_du.
OCTRAD_HD inline Vec3f bumped_normal(const TextureView& texture, const MaterialRecord& record,
                                     const SurfaceInteraction& surface, const Frame& frame, Vec3f wo) {
  Vec3f m = mapped_normal(texture, record, surface.uv, frame.to_local(surface.dp_du), frame.to_local(surface.dp_dv));
  const float l = length(m);
  m = l > 0.0f && std::isfinite(l) ? m / l : Vec3f(0, 0, 1);
  if (!record.normal_map && dot(frame.to_local(surface.geometric_normal), m) < 0.0f) m = -m;
  Vec3f v = frame.to_local(wo);
  const bool mirrored = record.bump_mirrored && v.z < 0.0f;  // the back shows the front's bumps
  if (mirrored) v.z = -v.z;
  m = flipped_normal(record, v, m);
  if (mirrored) m.z = -m.z;
  return frame.to_world(m);
}

// `wo`: unit, world space, away from the surface. The side is decided by the shading normal, as in Mitsuba.
template <Models kModels = Models::all>
OCTRAD_HD inline ShadingPoint shade(const MaterialsView& materials, const SurfaceInteraction& surface, Vec3f wo) {
  ShadingPoint p;
  p.surface = surface;
  p.wo = wo;
  p.front = dot(wo, surface.geometric_normal) > 0.0f;
  const MaterialRecord* record = &seen_record(materials, surface, wo);
  const Vec3f n = surface.shading_normal;
  const MaterialRecord& front = materials.records[surface.material];
  const bool two_sided = front.constant.two_sided;
  Frame frame = tangent_frame(n, surface.dp_du);
  if (record->bump >= 0) {
    const Vec3f bumped = bumped_normal(materials.textures[record->bump], *record, surface, frame, wo);
    frame = tangent_frame(bumped, frame.s);
    // Around two sides, the mapped normal decides which is seen.
    if (front.back >= 0 && !record->bump_mirrored)
      record = dot(wo, bumped) < 0.0f ? &materials.records[front.back] : &front;
  }
  material_at<kModels>(materials, *record, surface.uv, p.bsdf);
  p.bsdf.two_sided = two_sided;
  p.s = frame.s;
  p.t = frame.t;
  const float side = dot(wo, frame.n);
  const bool turned = two_sided && side < 0.0f && !record->bump_mirrored;
  p.ns = turned ? -frame.n : frame.n;
  if (record->bump >= 0) {
    p.bsdf.bumped = true;
    p.bsdf.shadowed = record->bump_shadows;
    p.bsdf.base_normal = p.to_local(turned || (record->bump_mirrored && dot(wo, n) < 0.0f) ? -n : n);
  }
  p.black = !two_sided && side <= 0.0f && !p.bsdf.both_sides;
  return p;
}

}  // namespace octrad
