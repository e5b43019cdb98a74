// A weighted mean of other materials (Mitsuba's `blendbsdf`), which may be blends themselves: the parts, and how much
// of each. What is done with them is in bsdf_math.h, which knows the other models.
#pragma once

#include "octrad/base/frame.h"
#include "octrad/shading/material_record.h"

namespace octrad {

struct BlendPart {
  const MaterialRecord* record = nullptr;
  float weight = 0.0f;  // with the opacity of masks around it
  bool turned = false;  // two-sided and seen from behind
};

OCTRAD_HD_APART inline float opacity_at(const MaterialRecord& record, Vec2f uv) {
  Bsdf b;
  b.opacity = record.constant.opacity;
  if (record.textured >> MaterialSlot::opacity & 1u) {
    assign_slot(b, MaterialSlot::opacity,
                evaluate_texture(record.tables.textures[record.textures[MaterialSlot::opacity]], uv));
  }
  return b.opacity;
}

struct BlendParts {
  BlendPart part[kMostBlended];
  int count = 0;
  float sum = 0.0f;  // of their weights: what is left of 1 passes through

  // The parts of the blend `root`, seen from the side of cos_o. Those that Mitsuba samples first come first.
  OCTRAD_HD_APART BlendParts(const MaterialRecord& root, Vec2f uv, float cos_o) {
    BlendPart open[kMostBlended];
    int top = 0;
    open[top++] = {&root, 1.0f, false};
    while (top > 0) {
      const BlendPart p = open[--top];
      if (p.record->blended[0] < 0) {
        part[count++] = p;
        sum += p.weight;
        continue;
      }
      float second = p.record->extra_at(ExtraParameter::weight, uv);
      second = second < 0.0f ? 0.0f : (second > 1.0f ? 1.0f : second);
      for (int i = 0; i < 2; ++i) {
        const float share = i == 0 ? 1.0f - second : second;
        if (!(share > 0.0f)) continue;
        BlendPart child = p;
        child.record = &p.record->tables.records[p.record->blended[i]];
        child.weight *= share * opacity_at(*child.record, uv);
        if (child.record->constant.two_sided && !p.turned && cos_o < 0.0f) {
          child.turned = true;
          if (child.record->back >= 0) child.record = &p.record->tables.records[child.record->back];
        }
        if (child.weight > 0.0f) open[top++] = child;
      }
    }
  }
};

OCTRAD_HD_APART inline float blend_opacity(const MaterialRecord& record, Vec2f uv) {
  return BlendParts(record, uv, 1.0f).sum;
}

// A part as a model of its own, with its directions: mirrored where it is turned, tilted where it has a normal map.
struct BlendedModel {
  Bsdf bsdf;
  bool turned;
  Frame frame;

  OCTRAD_HD_APART BlendedModel(const BlendPart& p, Vec2f uv, Vec3f wo)
      : turned(p.turned),
        frame{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}} {
    const MaterialRecord& record = *p.record;
    parameters_at(record.tables.textures, record, uv, bsdf);
    bsdf.opacity = 1.0f;
    if (record.bump < 0) return;
    Vec3f m = mapped_normal(record.tables.textures[record.bump], record, uv, Vec3f(1, 0, 0), Vec3f(0, 1, 0));
    const float l = length(m);
    m = l > 0.0f ? m / l : Vec3f(0, 0, 1);
    frame = tangent_frame(flipped_normal(record, mirrored(wo), m), {1, 0, 0});
    bsdf.bumped = true;
    bsdf.shadowed = record.bump_shadows;
    bsdf.base_normal = frame.to_local({0, 0, 1});
  }
  OCTRAD_HD Vec3f mirrored(Vec3f w) const { return turned ? Vec3f(w.x, w.y, -w.z) : w; }
  OCTRAD_HD Vec3f to_part(Vec3f w) const { return frame.to_local(mirrored(w)); }
  OCTRAD_HD Vec3f from_part(Vec3f w) const { return mirrored(frame.to_world(w)); }
};

struct BlendModel {
  static constexpr bool kDeltaOnly = false;

  OCTRAD_HD static BsdfValue evaluate(const Bsdf& b, Vec3f wo, Vec3f wi);
  OCTRAD_HD static BsdfSample sample(const Bsdf& b, Vec3f wo, float u_lobe, Vec2f u);
  OCTRAD_HD static Vec3f albedo(const Bsdf& b);
  OCTRAD_HD static float roughness(const Bsdf& b);
};

}  // namespace octrad
