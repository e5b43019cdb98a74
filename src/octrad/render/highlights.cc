#include "octrad/render/highlights.h"

#include <algorithm>
#include <cmath>

#include "octrad/geometry/surface_sampling_math.h"

namespace octrad {
namespace {

constexpr int kPointsOfShape = 32, kLightsOfPoint = 4;
constexpr std::size_t kMostShapes = 4096;

// A point of a shape: of a random triangle, whatever its size.
SurfaceInteraction point_of(const Scene& scene, int shape, Rng& rng) {
  const Shape& s = scene.shapes[static_cast<std::size_t>(shape)];
  const auto geometry = static_cast<std::size_t>(s.geometry);
  Hit hit;
  hit.shape = shape;
  hit.primitive = 0;
  Vec3f point(0.0f);
  const float pick = rng.uniform();
  const Vec2f u = rng.uniform2();
  if (s.kind == Shape::Kind::sphere) {
    point = uniform_sphere(scene.spheres[geometry], u);
  } else {
    const auto count = static_cast<float>(scene.meshes[geometry].triangles.size());
    hit.primitive = static_cast<int>(std::min(pick * count, count - 1.0f));
    const Vec2f b = uniform_triangle(u);
    hit.u = b.x;
    hit.v = b.y;
  }
  return interact(scene, hit, point, Vec3f(0.0f));
}

}  // namespace

double small_lamp_share(const PreparedScene& prepared, float alpha_below, float follow_below) {
  const Scene& scene = prepared.scene();
  const Lights& lights = prepared.lights();
  if (lights.empty()) return 0.0;
  double small = 0.0, all = 0.0;
  for (std::size_t shape = 0; shape < std::min(kMostShapes, scene.shapes.size()); ++shape) {
    const Shape& s = scene.shapes[shape];
    if (s.kind != Shape::Kind::sphere && scene.meshes[static_cast<std::size_t>(s.geometry)].triangles.empty()) continue;
    for (int i = 0; i < kPointsOfShape; ++i) {
      Rng rng(0, RngPurpose::lamps, shape * kPointsOfShape + static_cast<std::size_t>(i));
      const SurfaceInteraction surface = point_of(scene, static_cast<int>(shape), rng);
      Vec3f n = surface.geometric_normal;
      ShadingPoint point = shade(prepared.materials(), surface, n);
      if (point.black) point = shade(prepared.materials(), surface, n = -n);  // one-sided, seen from behind
      if (point.black || is_followed(point.bsdf, follow_below) || roughness_bsdf(point.bsdf) >= alpha_below) continue;
      for (int k = 0; k < kLightsOfPoint; ++k) {
        const float pick = rng.uniform();
        const LightSample light = lights.sample(surface.position, pick, rng.uniform2());
        if (!light.valid || !(light.pdf > 0.0f)) continue;
        const float cosine = dot(light.direction, n);
        const double reached = static_cast<double>(luminance(light.radiance) * std::max(0.0f, cosine) / light.pdf);
        if (!std::isfinite(reached)) continue;
        all += reached;
        // Lamps are sampled about uniformly over the solid angle that they fill.
        if (light.delta || static_cast<double>(lights.pick(pick) / light.pdf) < kSmallLamp) small += reached;
      }
    }
  }
  return all > 0.0 ? small / all : 0.0;
}

float bounce_below(const PreparedScene& scene, const Config& config) {
  const auto below = static_cast<float>(config.render_bounce_below);
  if (config.render_highlights == Highlights::cache || below <= 0.0f) return 0.0f;
  if (config.render_highlights == Highlights::bounce) return below;
  return small_lamp_share(scene, below, rhs_rules(config).follow_below) > kShareThatMatters ? below : 0.0f;
}

}  // namespace octrad
