#include "transport/path.h"

#include <algorithm>
#include <array>
#include <limits>

#include "shading/bsdf_math.h"

namespace octrad {
namespace {

// Paths that walk together: enough to hide memory latency, few enough that their state stays in the first caches.
constexpr std::size_t kGroup = 32;

struct Walker {
  PathSample* out = nullptr;
  Vec3f origin, direction;
  Vec3f vertex;                    // where the last scattering took place: `origin` before it was pushed off the surface
  float t_max = 0.0f;
  Vec3f throughput{1, 1, 1};
  float eta = 1.0f;                // product of relative indices: radiance shrinks by 1 / eta^2 inside glass and comes back
  float previous_pdf = 1.0f;       // of the direction that led here
  bool previous_delta = true;      // no next-event estimation could have found what this ray finds
  int depth = 0;
  float passed = 0.0f;             // distance of masked surfaces already passed, for the first hit's depth
  Hit hit;
  SurfaceInteraction surface;
};

// A shadow ray that waits for its turn, and what arrives if nothing is in its way.
struct Connection {
  PathSample* out;
  ShadowRay ray;
  Vec3f contribution;
};

class Group {
 public:
  Group(const TransportContext& context, const PathLimits& limits, PathCounters& counters) : context_(context), limits_(limits), counters_(counters) {}

  void run(std::span<PathSample> paths) {
    for (std::size_t i = 0; i < paths.size(); ++i) {
      Walker& w = walkers_[i];
      w = Walker{};
      w.out = &paths[i];
      w.origin = paths[i].ray.origin;
      w.direction = paths[i].ray.direction;
      w.t_max = paths[i].ray.t_max;
    }
    std::size_t alive = limits_.max_depth == 0 ? 0 : paths.size();
    while (alive > 0) {
      for (std::size_t i = 0; i < alive; ++i) {
        Walker& w = walkers_[i];
        w.hit = context_.tracer.intersect(w.origin, w.direction, 0.0f, w.t_max);
        prefetch_triangle(w.hit);
      }
      counters_.rays += static_cast<long long>(alive);
      for (std::size_t i = 0; i < alive; ++i) prefetch_vertices(walkers_[i].hit);
      for (std::size_t i = 0; i < alive; ++i) locate(walkers_[i]);
      connections_ = 0;
      std::size_t kept = 0;
      for (std::size_t i = 0; i < alive; ++i) {
        Walker& w = walkers_[i];
        if (!w.hit.valid() || !scatter(w)) continue;
        if (kept != i) walkers_[kept] = w;
        ++kept;
      }
      alive = kept;
      for (std::size_t i = 0; i < connections_; ++i) {
        const Connection& c = pending_[i];
        if (!context_.tracer.occluded(c.ray.origin, c.ray.direction, 0.0f, c.ray.t_max)) c.out->radiance += c.contribution;
      }
      counters_.rays += static_cast<long long>(connections_);
    }
  }

 private:
  void prefetch_triangle(const Hit& hit) const {
    if (!hit.valid()) return;
    const Shape& shape = context_.scene.shapes[static_cast<std::size_t>(hit.shape)];
    if (shape.kind != Shape::Kind::mesh) return;
    const TriangleMesh& mesh = context_.scene.meshes[static_cast<std::size_t>(shape.geometry)];
    __builtin_prefetch(mesh.triangles.data() + hit.primitive);
  }

  void prefetch_vertices(const Hit& hit) const {
    if (!hit.valid()) return;
    const Shape& shape = context_.scene.shapes[static_cast<std::size_t>(hit.shape)];
    if (shape.kind != Shape::Kind::mesh) return;
    const TriangleMesh& mesh = context_.scene.meshes[static_cast<std::size_t>(shape.geometry)];
    const Vec3i t = mesh.triangles[static_cast<std::size_t>(hit.primitive)];
    for (const int vertex : {t.x, t.y, t.z}) {
      __builtin_prefetch(mesh.positions.data() + vertex);
      if (!mesh.normals.empty()) __builtin_prefetch(mesh.normals.data() + vertex);
      if (!mesh.uvs.empty()) __builtin_prefetch(mesh.uvs.data() + vertex);
    }
  }

  // The surface that was hit, or the light of the environment.
  void locate(Walker& w) {
    if (!w.hit.valid()) {
      if (!context_.lights.has_environment()) return;
      const float weight = w.previous_delta ? 1.0f : w.previous_pdf / (w.previous_pdf + context_.lights.environment_pdf(w.direction));
      w.out->radiance += w.throughput * context_.lights.environment(w.direction) * weight;
      return;
    }
    w.surface = interact(context_.scene, w.hit, w.origin, w.direction);
    context_.materials.prefetch(w.surface.material, w.surface.uv);
  }

  // Emission, next-event estimation and the next direction. False where the path ends.
  bool scatter(Walker& w) {
    PathSample& out = *w.out;
    Rng& rng = out.rng;
    FirstHit& first = out.first;
    const SurfaceInteraction& surface = w.surface;
    if (surface.emitter >= 0) {
      const Vec3f emitted = context_.lights.emitted(surface, -w.direction);
      if (max_component(emitted) > 0.0f) {
        const float weight = w.previous_delta ? 1.0f : w.previous_pdf / (w.previous_pdf + context_.lights.pdf(w.vertex, surface));
        out.radiance += w.throughput * emitted * weight;
      }
    }
    const bool last = limits_.max_depth > 0 && w.depth + 1 >= limits_.max_depth;
    if (last && first.valid) return false;
    const ShadingPoint point = shade(context_.materials, surface, -w.direction);
    const Bsdf& bsdf = point.bsdf;
    const Vec3f wo = point.to_local(-w.direction);
    const float u_lobe = rng.uniform();
    if (!first.valid && u_lobe < bsdf.opacity) {
      first.valid = true;
      first.albedo = point.black ? Vec3f(0.0f) : albedo_bsdf(bsdf);
      first.normal = dot(point.ns, w.direction) > 0.0f ? -point.ns : point.ns;
      first.depth = w.passed + w.hit.t;
      first.roughness = roughness_bsdf(bsdf);
    }
    if (last || point.black) return false;

    if (!is_delta_bsdf(bsdf) && !context_.lights.empty()) {
      const float u_pick = rng.uniform();
      const LightSample light = context_.lights.sample(surface.position, u_pick, rng.uniform2());
      if (light.valid) {
        const BsdfValue f = evaluate_bsdf(bsdf, wo, point.to_local(light.direction));
        if (max_component(f.value) > 0.0f) {
          pending_[connections_++] = {&out, shadow_ray(surface.position, surface.geometric_normal, light),
                                      w.throughput * f.value * light.radiance * (1.0f / (light.pdf + f.pdf))};
        }
      }
    }

    const BsdfSample s = sample_bsdf(bsdf, wo, u_lobe, rng.uniform2());
    if (!s.valid) return false;
    w.throughput *= s.weight;
    w.eta *= s.eta;
    const float strongest = max_component(w.throughput);
    if (!(strongest > 0.0f)) return false;
    if (w.depth + 1 >= limits_.rr_depth) {
      const float survive = std::fmin(strongest * w.eta * w.eta, 0.95f);
      if (rng.uniform() >= survive) return false;
      w.throughput *= 1.0f / survive;
    }
    if (!s.null) w.direction = normalize(point.to_world(s.wi));
    w.vertex = surface.position;
    w.origin = offset_origin(surface.position, surface.geometric_normal, w.direction);
    w.t_max = std::numeric_limits<float>::infinity();
    w.previous_pdf = s.pdf;
    w.previous_delta = s.delta;
    if (!first.valid) w.passed += w.hit.t;
    ++w.depth;
    return true;
  }

  const TransportContext& context_;
  const PathLimits& limits_;
  PathCounters& counters_;
  std::array<Walker, kGroup> walkers_;
  std::array<Connection, kGroup> pending_;
  std::size_t connections_ = 0;
};

}  // namespace

void trace_paths(const TransportContext& context, const PathLimits& limits, std::span<PathSample> paths, PathCounters& counters) {
  Group group(context, limits, counters);
  for (std::size_t i = 0; i < paths.size(); i += kGroup) group.run(paths.subspan(i, std::min(kGroup, paths.size() - i)));
}

}  // namespace octrad
