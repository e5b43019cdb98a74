#include "transport/path.h"

#include <algorithm>
#include <array>
#include <limits>
#include <memory>

#include "shading/bsdf_math.h"

namespace octrad {
namespace {

// Paths that walk together: enough to hide memory latency and to fill packets of rays, few enough that their state stays in
// the near caches.
constexpr std::size_t kGroup = 128;

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
  float u_pick = 0.0f;
  Vec2f u_light;
  Hit hit;
  SurfaceInteraction surface;
};

// A shadow ray that waits for its turn, and what arrives if nothing is in its way.
struct Connection {
  PathSample* out;
  Vec3f contribution;
};

// Records are built in place (construct_at), not assigned: reading a fresh copy in wide pieces would wait for the narrow
// stores that made it.
class Group {
 public:
  Group(const TransportContext& context, const PathLimits& limits, PathCounters& counters)
      : context_(context), limits_(limits), counters_(counters), environment_(context.lights.has_environment()) {}

  void run(std::span<PathSample> paths) {
    for (std::size_t i = 0; i < paths.size(); ++i) {
      Walker& w = walkers_[i];
      std::construct_at(&w);
      w.out = &paths[i];
      w.origin = paths[i].ray.origin;
      w.direction = paths[i].ray.direction;
      w.t_max = paths[i].ray.t_max;
    }
    std::size_t alive = limits_.max_depth == 0 ? 0 : paths.size();
    for (std::size_t i = 0; i < alive; ++i) active_[i] = &walkers_[i];
    while (alive > 0) {
      for (std::size_t i = 0; i < alive; ++i) rays_[i] = {active_[i]->origin, active_[i]->direction, active_[i]->t_max};
      context_.tracer.intersect(std::span(rays_.data(), alive), hits_.data());
      for (std::size_t i = 0; i < alive; ++i) {
        Walker& w = *active_[i];
        w.hit = hits_[i];
        prefetch_triangle(w.hit);
        if (environment_) prefetch_light(w);
      }
      counters_.rays += static_cast<long long>(alive);
      for (std::size_t i = 0; i < alive; ++i) {
        prefetch_vertices(active_[i]->hit);
        if (environment_) context_.lights.prefetch_second(active_[i]->u_pick, active_[i]->u_light);
      }
      for (std::size_t i = 0; i < alive; ++i) locate(*active_[i]);
      connections_ = 0;
      std::size_t kept = 0;
      for (std::size_t i = 0; i < alive; ++i) {
        if (active_[i]->hit.valid() && scatter(*active_[i])) active_[kept++] = active_[i];
      }
      alive = kept;
      context_.tracer.occluded(std::span(shadow_rays_.data(), connections_), blocked_.data());
      for (std::size_t i = 0; i < connections_; ++i) {
        if (!blocked_[i]) pending_[i].out->radiance += pending_[i].contribution;
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

  // Environments are sampled from tables that do not fit into caches: their random numbers are drawn early.
  void prefetch_light(Walker& w) const {
    w.u_pick = w.out->rng.uniform();
    w.u_light = w.out->rng.uniform2();
    context_.lights.prefetch_first(w.u_pick, w.u_light);
  }

  // The surface that was hit, or the light of the environment.
  void locate(Walker& w) {
    if (!w.hit.valid()) {
      if (!context_.lights.has_environment()) return;
      float light_pdf = 0.0f;
      const Vec3f radiance = w.previous_delta ? context_.lights.environment(w.direction) : context_.lights.environment(w.direction, light_pdf);
      w.out->radiance += w.throughput * radiance * (w.previous_pdf / (w.previous_pdf + light_pdf));
      return;
    }
    std::construct_at(&w.surface, interact(context_.scene, w.hit, w.origin, w.direction));
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
      if (!environment_) {
        w.u_pick = rng.uniform();
        w.u_light = rng.uniform2();
      }
      const LightSample light = context_.lights.sample(surface.position, w.u_pick, w.u_light);
      if (light.valid) {
        const BsdfValue f = evaluate_bsdf(bsdf, wo, point.to_local(light.direction));
        if (max_component(f.value) > 0.0f) {
          std::construct_at(&shadow_rays_[connections_], shadow_ray(surface.position, surface.geometric_normal, light));
          Connection& c = pending_[connections_++];
          c.out = &out;
          c.contribution = w.throughput * f.value * light.radiance * (1.0f / (light.pdf + f.pdf));
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
  bool environment_;
  std::array<Walker, kGroup> walkers_;
  std::array<Walker*, kGroup> active_{};
  std::array<RayQuery, kGroup> rays_, shadow_rays_;
  std::array<Hit, kGroup> hits_;
  std::array<unsigned char, kGroup> blocked_;
  std::array<Connection, kGroup> pending_;
  std::size_t connections_ = 0;
};

}  // namespace

void trace_paths(const TransportContext& context, const PathLimits& limits, std::span<PathSample> paths, PathCounters& counters) {
  Group group(context, limits, counters);
  for (std::size_t i = 0; i < paths.size(); i += kGroup) group.run(paths.subspan(i, std::min(kGroup, paths.size() - i)));
}

}  // namespace octrad
