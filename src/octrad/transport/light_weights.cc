#include "octrad/transport/light_weights.h"

#include <algorithm>
#include <cmath>

#include "octrad/base/threads.h"
#include "octrad/transport/lhs_math.h"

namespace octrad {
namespace {

constexpr std::size_t kFewestPaths = 512, kMostPaths = 4096;
constexpr int kVertices = 4;         // of a path, at most
constexpr int kPasses = 16;          // masks, mirrors and glass of a path, at most
constexpr int kMostSampled = 32;     // emitters at a vertex
constexpr double kFewSamples = 8.0;  // of an emitter: half of what is left is picked uniformly
// Of the mean radiance of all vertices: where less arrives directly, most light is indirect.
constexpr double kIndirect = 0.3;

// What the emitters first, first + stride, ... (modulo their count) bring at a vertex.
struct Vertex {
  int first = 0;
  float brought[kMostSampled] = {};  // with the weight of the balance heuristic
  double radiance = 0.0;             // of all emitters
};

struct Emitters {
  int count, sampled, stride;
  explicit Emitters(int n) : count(n), sampled(std::min(n, kMostSampled)), stride(n / sampled) {}
  int at(const Vertex& vertex, int k) const { return (vertex.first + k * stride) % count; }
};

Vertex sample_emitters(const TransportContext& world, const Emitters& emitters, const ShadingPoint& point, Vec3f wo,
                       Rng& rng) {
  Vertex vertex;
  const SurfaceInteraction& surface = point.surface;
  vertex.first = static_cast<int>(rng.below(static_cast<std::uint32_t>(emitters.count)));
  const float pick = 1.0f / static_cast<float>(emitters.count);
  for (int k = 0; k < emitters.sampled; ++k) {
    const LightSample light =
        sample_picked_light(world.lights.view(), emitters.at(vertex, k), pick, surface.position, rng.uniform2());
    if (!light.valid || !(light.pdf > 0.0f)) continue;
    const BsdfValue f = evaluate_bsdf(point.bsdf, wo, point.to_local(light.direction));
    const float value = luminance(f.value * light.radiance);
    if (!(value > 0.0f)) continue;
    const RayQuery ray = shadow_ray(surface.position, surface.geometric_normal, light);
    if (world.occluded(ray.origin, ray.direction, 0.0f, ray.t_max)) continue;
    const double radiance = static_cast<double>(value * pick / light.pdf);
    const float brought = value / light_mis_density(light, f.pdf);
    if (!std::isfinite(radiance) || !std::isfinite(brought)) continue;
    vertex.brought[k] = brought;
    vertex.radiance += radiance * emitters.count / emitters.sampled;
  }
  return vertex;
}

std::vector<Vertex> follow_path(const TransportContext& world, const Emitters& emitters, const CameraView& view,
                                std::size_t path) {
  std::vector<Vertex> vertices;
  Rng rng(0, RngPurpose::picks, path);
  Ray ray = random_ray(view, rng);
  int rays = 0;
  Hit hit = camera_hit(world, ray, rays);
  for (int passed = 0; hit.valid() && static_cast<int>(vertices.size()) < kVertices && passed < kPasses;) {
    const SurfaceInteraction surface = world.interact(hit, ray.origin, ray.direction);
    const ShadingPoint point = world.shade(surface, -ray.direction);
    if (point.black && point.bsdf.opacity >= 1.0f) break;
    const Vec3f wo = point.to_local(-ray.direction);
    const float u_lobe = rng.uniform();
    const BsdfSample next = sample_bsdf(point.bsdf, wo, u_lobe, rng.uniform2());
    if (next.null || is_delta_bsdf(point.bsdf)) ++passed;
    else vertices.push_back(sample_emitters(world, emitters, point, wo, rng));
    if (!next.valid) break;
    if (!next.null) ray.direction = normalize(point.to_world(next.wi));
    ray.origin = offset_origin(surface.position, surface.geometric_normal, ray.direction);
    hit = world.intersect(ray.origin, ray.direction, 0.0f, kRayInfinity);
  }
  return vertices;
}

}  // namespace

std::vector<float> light_weights(const TransportContext& world) {
  const auto count = static_cast<std::size_t>(world.lights.view().count);
  std::vector<float> weights(count, 1.0f / static_cast<float>(std::max<std::size_t>(1, count)));
  if (count < 2 || world.scene.cameras.empty()) return weights;
  const Emitters emitters(static_cast<int>(count));
  std::vector<CameraView> views;
  for (const Camera& camera : world.scene.cameras)
    views.push_back(camera.view(std::max(1, camera.film_width), std::max(1, camera.film_height)));
  std::vector<std::vector<Vertex>> paths(std::clamp(2 * count, kFewestPaths, kMostPaths));
  parallel_blocks(paths.size(), 16, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) paths[i] = follow_path(world, emitters, views[i % views.size()], i);
  });

  double mean = 0.0, vertices = 0.0;
  for (const std::vector<Vertex>& path : paths) {
    for (const Vertex& v : path) mean += v.radiance, ++vertices;
  }
  if (!(mean > 0.0)) return weights;
  mean /= vertices;
  std::vector<double> squares(count, 0.0);
  for (const std::vector<Vertex>& path : paths) {
    for (const Vertex& v : path) {
      for (int k = 0; k < emitters.sampled; ++k) {
        const double share = static_cast<double>(v.brought[k]) / (v.radiance + kIndirect * mean);
        squares[static_cast<std::size_t>(emitters.at(v, k))] += share * share;
      }
    }
  }
  double sum = 0.0;
  for (const double s : squares) sum += std::sqrt(s);
  const double samples = vertices * emitters.sampled / static_cast<double>(count);
  const double uniform = kUniformPicks + (1.0 - kUniformPicks) * kFewSamples / (kFewSamples + samples);
  for (std::size_t i = 0; i < count; ++i) {
    weights[i] =
        static_cast<float>(uniform / static_cast<double>(count) + (1.0 - uniform) * std::sqrt(squares[i]) / sum);
  }
  return weights;
}

}  // namespace octrad
