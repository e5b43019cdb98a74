#include "octrad/transport/light_weights.h"

#include <algorithm>
#include <cmath>
#include <type_traits>

#include "octrad/base/threads.h"
#include "octrad/shading/environment_map.h"
#include "octrad/shading/place_grid.h"
#include "octrad/transport/lhs_math.h"

namespace octrad {
namespace {

constexpr std::size_t kFewestPaths = 512, kMostPaths = 4096;
constexpr int kVertices = 4;      // of a path, at most
constexpr int kPasses = 16;       // masks, mirrors and glass of a path, at most
constexpr int kMostSampled = 32;  // emitters at a vertex
constexpr int kDirections = 32;   // of the environment at a vertex
constexpr std::size_t kEnvironmentPaths = 1024;
constexpr int kPlaces = 4;              // along each axis
constexpr double kFewDirections = 4.0;  // drawn of a part: half of the weight is that of all places
constexpr double kFewSamples = 8.0;     // of an emitter: half of what is left is picked uniformly
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
  float value = luminance(f.value * light.radiance);
  if (!(value > 0.0f)) return {};
  RayQuery ray = shadow_ray(point.surface.position, point.surface.geometric_normal, light);
  value *= left_by_masks(world, light, ray);
  if (!(value > 0.0f) || world.occluded(ray.origin, ray.direction, 0.0f, ray.t_max)) return {};
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

// What `sample` (as at_vertex above) makes of the vertices of `paths` paths, in their order. Parallel.
template <typename Sample>
auto sample_vertices(const TransportContext& world, std::size_t paths, Sample sample) {
  using Found = std::invoke_result_t<Sample, const ShadingPoint&, Vec3f, Rng&>;
  std::vector<CameraView> views;
  for (const Camera& camera : world.scene.cameras) views.push_back(camera.own_view());
  std::vector<std::vector<Found>> of_paths(paths);
  parallel_blocks(paths, 16, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      follow_path(world, views[i % views.size()], i, [&](const ShadingPoint& point, Vec3f wo, Rng& rng) {
        of_paths[i].push_back(sample(point, wo, rng));
      });
    }
  });
  std::vector<Found> vertices;
  for (const std::vector<Found>& path : of_paths) vertices.insert(vertices.end(), path.begin(), path.end());
  return vertices;
}

// 0 without vertices.
template <typename Found>
double mean_radiance(const std::vector<Found>& vertices) {
  double sum = 0.0;
  for (const Found& v : vertices) sum += v.radiance;
  return vertices.empty() ? 0.0 : sum / static_cast<double>(vertices.size());
}

// A contribution beside all that arrives at a vertex, squared.
template <typename Found>
double relative_square(const Found& vertex, int k, double mean) {
  const double share = static_cast<double>(vertex.brought[k]) / (vertex.radiance + kIndirect * mean);
  return share * share;
}

// Directions sampled at a vertex: which part of the environment each is of (-1: none), and what it brings, with the
// weight of the balance heuristic.
struct Directions {
  Vec3f position;
  int part[kDirections] = {};
  float brought[kDirections] = {};
  double radiance = 0.0;  // of the environment
};

Directions sample_directions(const TransportContext& world, const ShadingPoint& point, Vec3f wo, Rng& rng) {
  Directions directions;
  const LightsView& lights = world.lights.view();
  const EnvironmentView& environment = lights.environment;
  const SurfaceInteraction& surface = point.surface;
  directions.position = surface.position;
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
  const auto vertices = sample_vertices(
      world, std::clamp(2 * count, kFewestPaths, kMostPaths),
      [&](const ShadingPoint& point, Vec3f wo, Rng& rng) { return sample_emitters(world, emitters, point, wo, rng); });
  const double mean = mean_radiance(vertices);
  if (!(mean > 0.0)) return weights;
  std::vector<double> squares(count, 0.0);
  for (const Vertex& v : vertices) {
    for (int k = 0; k < emitters.sampled; ++k)
      squares[static_cast<std::size_t>(emitters.at(v, k))] += relative_square(v, k, mean);
  }
  double sum = 0.0;
  for (const double s : squares) sum += std::sqrt(s);
  const double samples = static_cast<double>(vertices.size()) * emitters.sampled / static_cast<double>(count);
  const double uniform = kUniformPicks + (1.0 - kUniformPicks) * kFewSamples / (kFewSamples + samples);
  for (std::size_t i = 0; i < count; ++i) {
    weights[i] =
        static_cast<float>(uniform / static_cast<double>(count) + (1.0 - uniform) * std::sqrt(squares[i]) / sum);
  }
  return weights;
}

std::optional<EnvironmentPlaces> environment_places(const TransportContext& world) {
  const EnvironmentMap* map = world.lights.environment_map();
  if (map == nullptr || map->integrals().empty() || world.scene.cameras.empty()) return std::nullopt;
  const auto vertices = sample_vertices(world, kEnvironmentPaths, [&](const ShadingPoint& point, Vec3f wo, Rng& rng) {
    return sample_directions(world, point, wo, rng);
  });
  const double mean = mean_radiance(vertices);
  if (!(mean > 0.0)) return std::nullopt;

  EnvironmentPlaces places;
  std::vector<Vec3f> positions;
  for (const Directions& d : vertices) positions.push_back(d.position);
  places.grid = PlaceGrid(bounds_of_most(positions), kPlaces);
  const auto count = static_cast<std::size_t>(places.grid.count());
  constexpr std::size_t parts = kEnvironmentParts;
  // Samples, and sums of the squares of their relative contributions: of the parts at each place, and everywhere.
  struct Squares {
    double samples = 0.0, sum = 0.0;
    void add(double square) {
      samples += 1.0;
      sum += square;
    }
    // Their mean, where that of few samples is taken towards `otherwise`.
    double mean(double otherwise) const { return (sum + kFewDirections * otherwise) / (samples + kFewDirections); }
  };
  std::vector<Squares> here(count * parts), everywhere(parts);
  Squares all;
  for (const Directions& d : vertices) {
    const auto place = static_cast<std::size_t>(places.grid.place(d.position));
    for (int k = 0; k < kDirections; ++k) {
      if (d.part[k] < 0) continue;
      const auto part = static_cast<std::size_t>(d.part[k]);
      for (Squares* squares : {&here[place * parts + part], &everywhere[part], &all})
        squares->add(relative_square(d, k, mean));
    }
  }
  const double mean_square = all.mean(0.0);
  double total = 0.0;
  for (const float integral : map->integrals()) total += static_cast<double>(integral);
  for (std::size_t place = 0; place < count; ++place) {
    double by_radiance[parts], wanted[parts], sum = 0.0;
    for (std::size_t part = 0; part < parts; ++part) {
      const double square = here[place * parts + part].mean(everywhere[part].mean(mean_square));
      by_radiance[part] = static_cast<double>(map->integrals()[part]) / total;
      sum += wanted[part] = by_radiance[part] * std::sqrt(square);
    }
    for (std::size_t part = 0; part < parts; ++part) {
      places.shares.push_back(
          static_cast<float>(kUniformPicks * by_radiance[part] + (1.0 - kUniformPicks) * wanted[part] / sum));
    }
  }
  return places;
}

}  // namespace octrad
