#include "octrad/train/changed_points.h"

#include "octrad/base/error.h"
#include "octrad/base/threads.h"

namespace octrad {

ChangedPoints::ChangedPoints(const PreparedScene& scene, const LhsOptions& options, const SceneChange& change)
    : context_(scene.context()),
      options_(options),
      lights_(change.lights) {
  if (change.shapes.empty()) return;
  try {
    surfaces_ = std::make_unique<SurfaceSampler>(scene.scene(), change.shapes);
  } catch (const InputError&) {  // shapes without area
  }
}

// The surface from a fresh direction on the side of `side`.
bool ChangedPoints::look_at(const SurfaceInteraction& surface, Vec3f side, Rng& rng, ShadingPoint& point) const {
  const Vec2f u = rng.uniform2();
  const auto shade = [&](Vec3f wo) {
    point = context_.shade(surface, wo);
    point.bsdf.opacity = 1.0f;
    return !point.black && point.bsdf.type != BsdfType::null && !is_followed(point.bsdf, options_.follow_below);
  };
  if (!shade(cosine_direction(side, u))) return false;
  if (options_.uniform_glossy && roughness_bsdf(point.bsdf) < options_.rough_threshold) {
    const Vec3f wo = uniform_direction(u);
    if (!shade(dot(wo, side) < 0.0f ? -wo : wo)) return false;
  }
  if (options_.split_coats && has_lobes(point.bsdf)) point.bsdf.lobe = rng.uniform() < 0.5f ? Lobe::coat : Lobe::base;
  return true;
}

bool ChangedPoints::draw(Rng& rng, ShadingPoint& point) const {
  const bool on_surface = surfaces_ && (lights_.empty() || rng.uniform() < 0.5f);
  Vec3f origin, direction;
  if (on_surface) {
    const float u_pick = rng.uniform();
    const SurfaceInteraction surface = surfaces_->sample(u_pick, rng.uniform2());
    const Vec3f side = rng.uniform() < 0.5f ? -surface.geometric_normal : surface.geometric_normal;
    if (rng.uniform() < 0.5f) return look_at(surface, side, rng, point);
    direction = cosine_direction(side, rng.uniform2());
    origin = offset_origin(surface.position, surface.geometric_normal, side);
  } else {
    origin = lights_[rng.below(static_cast<std::uint32_t>(lights_.size()))];
    direction = uniform_direction(rng.uniform2());
  }
  const Hit hit = context_.intersect(origin, direction, 0.0f, kRayInfinity);
  if (!hit.valid()) return false;
  const SurfaceInteraction lit = context_.interact(hit, origin, direction);
  const Vec3f n = lit.geometric_normal;
  return look_at(lit, dot(n, direction) > 0.0f ? -n : n, rng, point);
}

void ChangedPoints::replace(unsigned long long step, std::span<ShadingPoint> points) const {
  if (empty()) return;
  parallel_blocks(points.size(), 32, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      Rng rng(options_.seed, RngPurpose::changed, mix64(step + 1) ^ i);
      ShadingPoint point;
      if (draw(rng, point)) points[i] = point;
    }
  });
}

}  // namespace octrad
