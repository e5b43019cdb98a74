#include <algorithm>
#include <array>
#include <map>
#include <memory>
#include <tuple>
#include <vector>

#include "octrad/base/threads.h"
#include "octrad/shading/compact_texture.h"
#include "octrad/shading/fresnel.h"
#include "octrad/shading/materials.h"
#include "octrad/shading/measured_summary.h"
#include "octrad/shading/rough_transmittance.h"

namespace octrad {
namespace {

using SlotTextures = std::array<int, kMaterialSlots>;

// Light passes through it, or its back is not black although it is not two-sided.
bool scatters_on_both_sides(const Scene& scene, const Material& m) {
  if (transmits(m.type) || m.extra[ExtraParameter::spec_trans] >= 0) return true;
  for (const int part : m.blended) {
    if (part < 0) continue;
    const Material& p = scene.materials[static_cast<std::size_t>(part)];
    const bool tilts_to_front = p.bump >= 0 && !p.bump_flips;  // a mapped normal may face who sees the surface's back
    if (p.two_sided || tilts_to_front || scatters_on_both_sides(scene, p)) return true;
  }
  return false;
}

// A blend has parts that let rays pass straight through.
bool has_masked_parts(const Scene& scene, const Material& m) {
  for (const int part : m.blended) {
    if (part < 0) continue;
    const Material& p = scene.materials[static_cast<std::size_t>(part)];
    if (p.opacity >= 0 || p.type == BsdfType::null || has_masked_parts(scene, p)) return true;
  }
  return false;
}

// The texture of each slot, -1: none.
SlotTextures slot_textures(const Material& m) {
#define OCTRAD_MEMBER(name) m.name,
  SlotTextures out = {OCTRAD_MATERIAL_SLOTS(OCTRAD_MEMBER) m.opacity};
#undef OCTRAD_MEMBER
  if (m.alpha_v < 0) out[MaterialSlot::alpha_v] = m.alpha_u;
  return out;
}

}  // namespace

struct Materials::Impl {
  const Scene& scene;
  std::vector<MaterialRecord> records;
  std::map<std::tuple<int, float, float>, std::unique_ptr<RoughTransmittance>> tables;
  std::vector<std::unique_ptr<CompactTexture>> compact;  // of the scene's textures, by index; null where there is none
  std::vector<TextureView> textures;                     // of the scene, by index
  std::vector<MeasuredSummary> summaries;                // of the scene's measured materials

  MaterialRecord record(const Material& m, const MaterialEdit& edit);
};

MaterialRecord Materials::Impl::record(const Material& m, const MaterialEdit& edit) {
  MaterialRecord r;
  Bsdf& b = r.constant;
  b.type = m.type;
  b.distribution = m.distribution;
  b.two_sided = m.two_sided;
  b.both_sides = scatters_on_both_sides(scene, m);
  if (m.type == BsdfType::null) b.opacity = 0.0f;
  b.nonlinear = m.nonlinear;
  b.sample_visible = m.sample_visible;
  b.eta = m.int_ior / m.ext_ior;
  b.conductor_eta = m.eta;
  b.conductor_k = m.k;
  b.alpha_u = b.alpha_v = 0.1f;  // Mitsuba's default
  r.back = m.back;
  const SlotTextures index = slot_textures(m);
  b.reflectance = Vec3f(0.5f);
  for (int i = 0; i < kMaterialSlots; ++i) {
    const int t = index[static_cast<std::size_t>(i)];
    if (t < 0) continue;
    const Texture& texture = scene.textures[static_cast<std::size_t>(t)];
    if (texture.kind == Texture::Kind::constant) {
      assign_slot(b, i, texture.color0);
    } else {
      r.textured |= 1u << i;
      r.textures[i] = t;
    }
  }
  if (m.bump >= 0) {
    const Texture& texture = scene.textures[static_cast<std::size_t>(m.bump)];
    if (texture.kind != Texture::Kind::constant || m.normal_map) {
      r.bump = m.bump;
      r.bump_scale = m.bump_scale;
      r.normal_map = m.normal_map;
      r.bump_mirrored = m.bump_mirrored;
      r.bump_flips = m.bump_flips;
      r.bump_shadows = m.bump_shadows;
    }
  }
  for (int i = 0; i < ExtraParameter::count; ++i) {
    const int t = m.extra[i];
    if (t < 0) continue;
    const Texture& texture = scene.textures[static_cast<std::size_t>(t)];
    r.extra[i] = texture.color0.x;
    r.extra_textures[i] = t;
    if (texture.kind != Texture::Kind::constant) r.extra_textured |= 1u << i;
  }
  r.blended[0] = m.blended[0];
  r.blended[1] = m.blended[1];
  r.masked_parts = has_masked_parts(scene, m);
  if (m.measured >= 0) {
    const MeasuredMaterial& measured = scene.measured[static_cast<std::size_t>(m.measured)];
    r.measured = {measured.data.data(), measured.layout};
    const MeasuredSummary& summary = summaries[static_cast<std::size_t>(m.measured)];
    b.specular_reflectance = summary.albedo;
    b.alpha_u = b.alpha_v = summary.roughness;
  }
  if (const int slot = color_slot(m.type); edit.color && slot >= 0) {
    assign_slot(b, slot, *edit.color);
    r.textured &= ~(1u << slot);
  }
  if (edit.roughness && needs_record(m.type)) {
    r.extra[ExtraParameter::roughness] = *edit.roughness;
    r.extra_textured &= ~(1u << ExtraParameter::roughness);
  } else if (edit.roughness && has_roughness(m.type)) {
    b.alpha_u = b.alpha_v = *edit.roughness;
    r.textured &= ~(1u << MaterialSlot::alpha_u | 1u << MaterialSlot::alpha_v);
  }
  if (m.type == BsdfType::plastic) b.internal_reflectance = fresnel_diffuse_reflectance(1.0f / b.eta);
  if (m.type == BsdfType::roughplastic) {
    auto& table = tables[{static_cast<int>(b.distribution), b.alpha_u, b.eta}];
    if (!table)
      table = std::make_unique<RoughTransmittance>(compute_rough_transmittance(b.distribution, b.alpha_u, b.eta));
    b.internal_reflectance = table->internal_reflectance;
    b.external_transmittance = table->external.data();
  }
  return r;
}

Materials::Materials(const Scene& scene) : impl_(new Impl{scene, {}, {}, {}, {}, {}}) {
  impl_->compact.resize(scene.textures.size());
  std::vector<char> used(scene.textures.size(), 0);
  for (const Material& m : scene.materials) {
    for (const int i : slot_textures(m)) {
      if (i >= 0) used[static_cast<std::size_t>(i)] = 1;
    }
    for (const int i : m.extra) {
      if (i >= 0) used[static_cast<std::size_t>(i)] = 1;
    }
  }
  parallel_for(scene.textures.size(), [&](std::size_t i) {
    if (used[i]) impl_->compact[i] = CompactTexture::make(scene.textures[i]);
  });
  for (std::size_t i = 0; i < scene.textures.size(); ++i) {
    impl_->textures.push_back(impl_->compact[i] ? impl_->compact[i]->view() : texture_view(scene.textures[i]));
  }
  impl_->summaries.resize(scene.measured.size());
  parallel_for(scene.measured.size(), [&](std::size_t i) { impl_->summaries[i] = summarize(scene.measured[i]); });
  for (const Material& m : scene.materials) impl_->records.push_back(impl_->record(m, {}));
  view_ = {impl_->records.data(), impl_->textures.data()};
  for (MaterialRecord& r : impl_->records) r.refer(view_);
}

Materials::~Materials() = default;

void Materials::set_edit(int index, const MaterialEdit& edit) {
  const auto i = static_cast<std::size_t>(index);
  impl_->records[i] = impl_->record(impl_->scene.materials[i], edit);
  impl_->records[i].refer(view_);
  std::erase_if(impl_->tables, [this](const auto& table) {
    return std::none_of(impl_->records.begin(), impl_->records.end(), [&](const MaterialRecord& r) {
      return r.constant.external_transmittance == table.second->external.data();
    });
  });
}

int color_slot(BsdfType type) {
  switch (type) {
    case BsdfType::conductor:
    case BsdfType::roughconductor: return MaterialSlot::specular_reflectance;
    case BsdfType::dielectric:
    case BsdfType::thindielectric:
    case BsdfType::roughdielectric:
    case BsdfType::hair: return MaterialSlot::specular_transmittance;
    case BsdfType::null:
    case BsdfType::blendbsdf:
    case BsdfType::measured: return -1;
    default: return MaterialSlot::reflectance;
  }
}

bool has_roughness(BsdfType type) {
  switch (type) {
    case BsdfType::roughplastic:
    case BsdfType::roughconductor:
    case BsdfType::roughdielectric:
    case BsdfType::principled:
    case BsdfType::principledthin:
    case BsdfType::roughdiffuse:
    case BsdfType::hair: return true;
    default: return false;
  }
}

std::size_t Materials::size() const { return impl_->records.size(); }
std::size_t Materials::texture_count() const { return impl_->textures.size(); }

Bsdf Materials::at(int index, Vec2f uv) const {
  Bsdf b;
  material_at<>(view_, view_.records[index], uv, b);
  return b;
}

void Materials::prefetch(int index, Vec2f uv) const {
  const MaterialRecord& r = view_.records[index];
  for (std::uint32_t left = r.textured; left != 0; left &= left - 1) {
    const TextureView& texture = view_.textures[r.textures[lowest_bit(left)]];
    if (texture.tiles != nullptr) CompactTexture::prefetch(texture, uv);
  }
}

ShadingPoint shade(const Materials& materials, const SurfaceInteraction& surface, Vec3f wo) {
  return shade<>(materials.view(), surface, wo);
}

}  // namespace octrad
