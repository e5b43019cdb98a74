#include <cstdint>
#include <map>
#include <memory>
#include <tuple>
#include <vector>

#include "base/threads.h"
#include "shading/bsdf.h"
#include "shading/bsdf_math.h"
#include "shading/compact_texture.h"
#include "shading/fresnel.h"
#include "shading/rough_transmittance.h"

namespace octrad {
namespace {

// Parameters that a texture may drive.
enum Slot : std::uint32_t { kReflectance = 1, kSpecularReflectance = 2, kSpecularTransmittance = 4, kAlphaU = 8, kAlphaV = 16, kOpacity = 32 };

float clamp01(float x) { return x < 0.0f ? 0.0f : (x > 1.0f ? 1.0f : x); }

void assign(Bsdf& b, Slot slot, Vec3f value) {
  switch (slot) {
    case kReflectance: b.reflectance = value; break;
    case kSpecularReflectance: b.specular_reflectance = value; break;
    case kSpecularTransmittance: b.specular_transmittance = value; break;
    case kAlphaU: b.alpha_u = value.x; break;
    case kAlphaV: b.alpha_v = value.x; break;
    case kOpacity: b.opacity = clamp01(value.x); break;
  }
}

}  // namespace

struct Materials::Record {
  Bsdf constant;                   // every parameter that does not vary over the surface
  std::uint32_t textured = 0;      // slots that do
  const Texture* textures[6] = {};
  const CompactTexture* compact[6] = {};  // instead, where there is one
  const Texture* bump = nullptr;
  float bump_scale = 1.0f;
  int back = -1;
};

struct Materials::Impl {
  std::vector<Record> records;
  std::map<std::tuple<int, float, float>, std::unique_ptr<RoughTransmittance>> tables;
  std::vector<std::unique_ptr<CompactTexture>> compact;  // of the scene's textures, by index
};

namespace {
constexpr Slot kSlots[6] = {kReflectance, kSpecularReflectance, kSpecularTransmittance, kAlphaU, kAlphaV, kOpacity};
}

Materials::Materials(const Scene& scene) : impl_(std::make_unique<Impl>()) {
  impl_->compact.resize(scene.textures.size());
  std::vector<char> used(scene.textures.size(), 0);
  for (const Material& m : scene.materials) {
    for (const int i : {m.reflectance, m.specular_reflectance, m.specular_transmittance, m.alpha_u, m.alpha_v, m.opacity}) {
      if (i >= 0) used[static_cast<std::size_t>(i)] = 1;
    }
  }
  parallel_for(scene.textures.size(), [&](std::size_t i) {
    if (used[i]) impl_->compact[i] = CompactTexture::make(scene.textures[i]);
  });
  for (const Material& m : scene.materials) {
    Record r;
    Bsdf& b = r.constant;
    b.type = m.type;
    b.distribution = m.distribution;
    b.two_sided = m.two_sided;
    b.nonlinear = m.nonlinear;
    b.sample_visible = m.sample_visible;
    b.eta = m.int_ior / m.ext_ior;
    b.conductor_eta = m.eta;
    b.conductor_k = m.k;
    b.alpha_u = b.alpha_v = 0.1f;  // Mitsuba's default
    r.back = m.back;
    const int index[6] = {m.reflectance, m.specular_reflectance, m.specular_transmittance, m.alpha_u,
                          m.alpha_v >= 0 ? m.alpha_v : m.alpha_u, m.opacity};
    b.reflectance = Vec3f(0.5f);
    for (int i = 0; i < 6; ++i) {
      if (index[i] < 0) continue;
      const Texture& texture = scene.textures[static_cast<std::size_t>(index[i])];
      if (texture.kind == Texture::Kind::constant) {
        assign(b, kSlots[i], texture.color0);
      } else {
        r.textured |= kSlots[i];
        r.textures[i] = &texture;
        r.compact[i] = impl_->compact[static_cast<std::size_t>(index[i])].get();
      }
    }
    if (m.bump >= 0) {
      const Texture& texture = scene.textures[static_cast<std::size_t>(m.bump)];
      if (texture.kind != Texture::Kind::constant) {
        r.bump = &texture;
        r.bump_scale = m.bump_scale;
      }
    }
    if (m.type == BsdfType::plastic) b.internal_reflectance = fresnel_diffuse_reflectance(1.0f / b.eta);
    if (m.type == BsdfType::roughplastic) {
      auto& table = impl_->tables[{static_cast<int>(b.distribution), b.alpha_u, b.eta}];
      if (!table) table = std::make_unique<RoughTransmittance>(compute_rough_transmittance(b.distribution, b.alpha_u, b.eta));
      b.internal_reflectance = table->internal_reflectance;
      b.external_transmittance = table->external.data();
    }
    impl_->records.push_back(r);
  }
}

Materials::~Materials() = default;

const Materials::Record& Materials::record(int index) const { return impl_->records[static_cast<std::size_t>(index)]; }

Bsdf Materials::at(int index, Vec2f uv) const {
  Bsdf b;
  at(index, uv, b);
  return b;
}

void Materials::at(int index, Vec2f uv, Bsdf& b) const {
  const Record& r = record(index);
  b = r.constant;
  if (r.textured == 0) return;
  for (int i = 0; i < 6; ++i) {
    if (r.textured & kSlots[i]) assign(b, kSlots[i], r.compact[i] ? r.compact[i]->evaluate(uv) : evaluate(*r.textures[i], uv));
  }
}

void Materials::prefetch(int index, Vec2f uv) const {
  const Record& r = record(index);
  if (r.textured == 0) return;
  for (const CompactTexture* texture : r.compact) {
    if (texture) texture->prefetch(uv);
  }
}

namespace {

// Mitsuba's `bumpmap`: displaces the surface along its shading normal and takes the normal of the result.
Vec3f bumped_normal(const Texture& texture, float scale, const SurfaceInteraction& surface) {
  const Vec3f n = surface.shading_normal;
  const Vec2f g = gradient(texture, surface.uv) * scale;
  const Vec3f du = surface.dp_du + n * (g.x - dot(n, surface.dp_du));
  const Vec3f dv = surface.dp_dv + n * (g.y - dot(n, surface.dp_dv));
  const Vec3f c = cross(du, dv);
  const float l = length(c);
  if (!(l > 0.0f)) return n;
  const Vec3f m = c / l;
  return dot(surface.geometric_normal, m) < 0.0f ? -m : m;
}

}  // namespace

ShadingPoint shade(const Materials& materials, const SurfaceInteraction& surface, Vec3f wo) {
  ShadingPoint p;
  p.surface = surface;
  p.wo = wo;
  p.front = dot(wo, surface.geometric_normal) > 0.0f;
  int material = surface.material;
  const Materials::Record* record = &materials.record(material);
  Vec3f n = surface.shading_normal;
  const bool two_sided = record->constant.two_sided;
  if (two_sided && record->back >= 0 && dot(wo, n) < 0.0f) {
    material = record->back;
    record = &materials.record(material);
  }
  materials.at(material, surface.uv, p.bsdf);
  p.bsdf.two_sided = two_sided;
  if (record->bump) n = bumped_normal(*record->bump, record->bump_scale, surface);
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
  if (record->bump) {
    p.bsdf.bumped = true;
    p.bsdf.base_normal = p.to_local(two_sided && side < 0.0f ? -surface.shading_normal : surface.shading_normal);
  }
  p.black = !two_sided && side <= 0.0f && p.bsdf.opacity >= 1.0f && !transmits_bsdf(p.bsdf);
  return p;
}

}  // namespace octrad
