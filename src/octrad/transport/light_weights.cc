#include "octrad/transport/light_weights.h"

#include <algorithm>
#include <cmath>

#include "octrad/base/threads.h"
#include "octrad/transport/lhs_math.h"

namespace octrad {
namespace {

constexpr std::size_t kFewestPaths = 512, kMostPaths = 4096;
constexpr int kVertices = 4;      // of a path, at most
constexpr int kPasses = 16;       // masks, mirrors and glass of a path, at most
constexpr int kMostSampled = 32;  // emitters at a vertex
constexpr int kDirections = 32;   // of the environment at a vertex
constexpr std::size_t kEnvironmentPaths = 1024;
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

// What a sample brings if it is not occluded, else 0: with the weight of the balance heuristic, and without BSDF rays.
struct Meeting {
  float brought = 0.0f;
  double radiance = 0.0;
};

Meeting meet(const TransportContext& world, const ShadingPoint& point, Vec3f wo, const LightSample& light) {
  const BsdfValue f = evaluate_bsdf(point.bsdf, wo, point.to_local(light.direction));
  const float value = luminance(f.value * light.radiance);
  if (!(value > 0.0f)) return {};
  const RayQuery ray = shadow_ray(point.surface.position, point.surface.geometric_normal, light);
  if (world.occluded(ray.origin, ray.direction, 0.0f, ray.t_max)) return {};
  const Meeting met{value / light_mis_density(light, f.pdf), static_cast<double>(value / light.pdf)};
  return std::isfinite(met.radiance) && std::isfinite(met.brought) ? met : Meeting{};
}

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
    const Meeting met = meet(world, point, wo, light);
    vertex.brought[k] = met.brought;
    vertex.radiance += met.radiance / emitters.sampled;
  }
  return vertex;
}

// Calls at_vertex(ShadingPoint, wo in its frame, rng) at the first vertices of a path from a sensor.
template <typename AtVertex>
void follow_path(const TransportContext& world, const CameraView& view, std::size_t path, AtVertex at_vertex) {
  Rng rng(0, RngPurpose::picks, path);
  Ray ray = random_ray(view, rng);
  int rays = 0;
  Hit hit = camera_hit(world, ray, rays);
  for (int vertices = 0, passed = 0; hit.valid() && vertices < kVertices && passed < kPasses;) {
    const SurfaceInteraction surface = world.interact(hit, ray.origin, ray.direction);
    const ShadingPoint point = world.shade(surface, -ray.direction);
    if (point.black && point.bsdf.opacity >= 1.0f) break;
    const Vec3f wo = point.to_local(-ray.direction);
    const float u_lobe = rng.uniform();
    const BsdfSample next = sample_bsdf(point.bsdf, wo, u_lobe, rng.uniform2());
    if (next.null || is_delta_bsdf(point.bsdf)) {
      ++passed;
    } else {
      ++vertices;
      at_vertex(point, wo, rng);
    }
    if (!next.valid) break;
    if (!next.null) ray.direction = normalize(point.to_world(next.wi));
    ray.origin = offset_origin(surface.position, surface.geometric_normal, ray.direction);
    hit = world.intersect(ray.origin, ray.direction, 0.0f, kRayInfinity);
  }
}

std::vector<CameraView> sensor_views(const Scene& scene) {
  std::vector<CameraView> views;
  for (const Camera& camera : scene.cameras)
    views.push_back(camera.view(std::max(1, camera.film_width), std::max(1, camera.film_height)));
  return views;
}

// Directions sampled at a vertex: which part of the environment each is of (-1: none), and what it brings, with the
// weight of the balance heuristic.
struct Directions {
  int part[kDirections] = {};
  float brought[kDirections] = {};
  double radiance = 0.0;  // of the environment
};

Directions sample_directions(const TransportContext& world, const ShadingPoint& point, Vec3f wo, Rng& rng) {
  Directions directions;
  const LightsView& lights = world.lights.view();
  const EnvironmentView& environment = lights.environment;
  const SurfaceInteraction& surface = point.surface;
  for (int k = 0; k < kDirections; ++k) {
    const LightSample light = sample_picked_light(lights, lights.count - 1, 1.0f, surface.position, rng.uniform2());
    directions.part[k] = -1;
    if (!light.valid || !(light.pdf > 0.0f)) continue;
    directions.part[k] = environment_part(environment, light.direction);
    const Meeting met = meet(world, point, wo, light);
    directions.brought[k] = met.brought;
    directions.radiance += met.radiance / kDirections;
  }
  return directions;
}

}  // namespace

std::vector<float> light_weights(const TransportContext& world) {
  const auto count = static_cast<std::size_t>(world.lights.view().count);
  std::vector<float> weights(count, 1.0f / static_cast<float>(std::max<std::size_t>(1, count)));
  if (count < 2 || world.scene.cameras.empty()) return weights;
  const Emitters emitters(static_cast<int>(count));
  const std::vector<CameraView> views = sensor_views(world.scene);
  std::vector<std::vector<Vertex>> paths(std::clamp(2 * count, kFewestPaths, kMostPaths));
  parallel_blocks(paths.size(), 16, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      follow_path(world, views[i % views.size()], i, [&](const ShadingPoint& point, Vec3f wo, Rng& rng) {
        paths[i].push_back(sample_emitters(world, emitters, point, wo, rng));
      });
    }
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

std::vector<float> environment_factors(const TransportContext& world) {
  const EnvironmentView& environment = world.lights.view().environment;
  if (!world.lights.has_environment() || environment.height < 2 || world.scene.cameras.empty()) return {};
  const std::vector<CameraView> views = sensor_views(world.scene);
  std::vector<std::vector<Directions>> paths(kEnvironmentPaths);
  parallel_blocks(paths.size(), 16, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      follow_path(world, views[i % views.size()], i, [&](const ShadingPoint& point, Vec3f wo, Rng& rng) {
        paths[i].push_back(sample_directions(world, point, wo, rng));
      });
    }
  });

  double mean = 0.0, vertices = 0.0;
  for (const std::vector<Directions>& path : paths) {
    for (const Directions& d : path) mean += d.radiance, ++vertices;
  }
  if (!(mean > 0.0)) return {};
  mean /= vertices;
  std::vector<double> samples(kEnvironmentParts, 0.0), squares(kEnvironmentParts, 0.0);
  double all = 0.0;
  for (const std::vector<Directions>& path : paths) {
    for (const Directions& d : path) {
      for (int k = 0; k < kDirections; ++k) {
        if (d.part[k] < 0) continue;
        const double share = static_cast<double>(d.brought[k]) / (d.radiance + kIndirect * mean);
        const auto part = static_cast<std::size_t>(d.part[k]);
        samples[part] += 1.0;
        squares[part] += share * share;
        all += 1.0;
      }
    }
  }
  // Of all samples a share of samples[i] / all is in part i; with the factor sqrt(squares[i] / samples[i]), and another
  // for all so that these shares sum to 1, the expected square of the relative error is least.
  double sum = 0.0;
  for (std::size_t i = 0; i < samples.size(); ++i) sum += std::sqrt(squares[i] * samples[i]);
  std::vector<float> factors(samples.size(), 1.0f);
  for (std::size_t i = 0; i < samples.size(); ++i) {
    if (!(samples[i] > 0.0)) continue;
    const double uniform = kUniformPicks + (1.0 - kUniformPicks) * kFewSamples / (kFewSamples + samples[i]);
    factors[i] = static_cast<float>(uniform + (1.0 - uniform) * std::sqrt(squares[i] / samples[i]) * all / sum);
  }
  return factors;
}

}  // namespace octrad
