// Parameters of materials as shading reads them: what is the same all over a surface, and the textures of the rest. For
// host and device; Materials makes the records (shading/materials.h).
#pragma once

#include <cstdint>

#include "octrad/base/bits.h"
#include "octrad/scene/measured_tables.h"
#include "octrad/scene/texture_math.h"
#include "octrad/shading/bsdf_types.h"

namespace octrad {

// What a texture may drive: the parameters of OCTRAD_MATERIAL_SLOTS, and the opacity of a mask.
struct MaterialSlot {
#define OCTRAD_NAME(name) name,
  enum : int { OCTRAD_MATERIAL_SLOTS(OCTRAD_NAME) opacity, count };
#undef OCTRAD_NAME
};
inline constexpr int kMaterialSlots = MaterialSlot::count;

struct MaterialsView {
  const MaterialRecord* records = nullptr;
  const TextureView* textures = nullptr;
};

struct MeasuredView {
  const float* data = nullptr;
  MeasuredLayout layout;
};

struct MaterialRecord {
  Bsdf constant;                      // every parameter that does not vary over the surface
  std::uint32_t textured = 0;         // bit s: slot s does
  int textures[kMaterialSlots] = {};  // of those slots
  int bump = -1;                      // texture
  float bump_scale = 1.0f;
  bool normal_map = false, bump_mirrored = false, bump_flips = false, bump_shadows = false;  // as in Material
  bool masked_parts = false;  // a blend that lets light pass where its parts do
  int back = -1;              // record of the other side

  // What only models with constant.record (this record) have.
  MaterialsView tables;  // what the indices below mean
  int blended[2] = {-1, -1};
  float extra[ExtraParameter::count] = {};  // constant ones
  std::uint32_t extra_textured = 0;
  int extra_textures[ExtraParameter::count] = {};
  MeasuredView measured;

  // Sets what refers to other tables, which this record is one of. Parts of blends need it as blends do.
  OCTRAD_HD void refer(const MaterialsView& view) {
    tables = view;
    constant.record = needs_record(constant.type) ? this : nullptr;
  }
  // Number `i` of ExtraParameter. Apart: models look up ten of them, and each texture look-up is large.
  OCTRAD_HD_APART float extra_at(int i, Vec2f uv) const {
    if ((extra_textured >> i & 1u) == 0) return extra[i];
    return evaluate_texture(tables.textures[extra_textures[i]], uv).x;
  }
};

// Where functions that take a model's parameters by value find its extra ones when they need them.
struct ExtraParameters {
  const MaterialRecord* record;
  Vec2f uv;
  OCTRAD_HD explicit ExtraParameters(const Bsdf& b) : record(b.record), uv(b.uv) {}
  OCTRAD_HD float at(int parameter) const { return record->extra_at(parameter, uv); }
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

// Parameters of one side of a material, but for the opacity of a blend's parts; bump mapping is applied by shade().
OCTRAD_HD inline void parameters_at(const TextureView* textures, const MaterialRecord& record, Vec2f uv, Bsdf& b) {
  b = record.constant;
  if (b.record != nullptr) b.uv = uv;
#if defined(__CUDA_ARCH__)
#pragma unroll 1
#endif
  for (std::uint32_t left = record.textured; left != 0; left &= left - 1) {
    const auto slot = static_cast<int>(lowest_bit(left));
    assign_slot(b, slot, evaluate_texture(textures[record.textures[slot]], uv));
  }
}

// Normal of a bump or normal map in the frame (s, t, n) of the surface, where s runs along dp_du: not unit, and zero
// where there is none. `du`, `dv`: dp_du and dp_dv in that frame.
OCTRAD_HD inline Vec3f mapped_normal(const TextureView& texture, const MaterialRecord& record, Vec2f uv, Vec3f du,
                                     Vec3f dv) {
  if (record.normal_map) return evaluate_texture(texture, uv) * 2.0f - Vec3f(1.0f);
  // Displaces the surface along its normal and takes the normal of the result (Mitsuba's `bumpmap`).
  const Vec2f g = texture_gradient(texture, uv) * record.bump_scale;
  return cross(Vec3f(du.x, du.y, g.x), Vec3f(dv.x, dv.y, g.y));
}

// A mapped normal that the viewer in `wo` would see from behind is turned about the surface's normal (Schuessler et al.
// 2017, "Microfacet-based Normal Mapping for Robust Monte Carlo Path Tracing", section 4).
OCTRAD_HD inline Vec3f flipped_normal(const MaterialRecord& record, Vec3f wo, Vec3f m) {
  return record.bump_flips && wo.z * dot(wo, m) <= 0.0f ? Vec3f(-m.x, -m.y, m.z) : m;
}

// Share of light that arrives along a direction with cosine `cos`, not 0, to the surface's normal where a map tilts the
// normal by an angle of cosine `tilt` (Estevez et al. 2019, "A Microfacet-Based Shadowing Function to Solve the Bump
// Terminator Problem").
OCTRAD_HD inline float bump_shadowing(float tilt, float cos) {
  const float tilt2 = tilt * tilt, cos2 = cos * cos;
  const float t = 0.125f * (1.0f - tilt2) / tilt2;  // below 0 by rounding where the map does not tilt
  const float alpha2 = t > 0.0f ? (t < 1.0f ? t : 1.0f) : 0.0f;
  const float sin2 = cos2 < 1.0f ? 1.0f - cos2 : 0.0f, c = std::fabs(cos);
  const float root = std::sqrt(cos2 + alpha2 * sin2);
  return 2.0f * c / (c + (root > c ? root : c));
}

}  // namespace octrad
