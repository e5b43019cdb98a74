#include "octrad/transport/path.h"

#include <algorithm>
#include <array>

#include "octrad/base/flat.h"
#include "octrad/base/prefetch.h"

namespace octrad {
namespace {

// Paths that are advanced together: enough to hide memory latency and to fill packets of rays, few enough that their
// state stays in the near caches.
constexpr std::size_t kGroup = 128;

struct Walker {
  PathSample* out = nullptr;
  PathState path;
  Lights::Draw light;  // begun early where there is an environment
  Hit hit;
  SurfaceInteraction surface;
};

// The contribution of a shadow ray that is not traced yet.
struct PendingConnection {
  PathSample* out;
  Vec3f contribution;
};

// Records are built in place (construct_at), not assigned: reading a fresh copy in wide pieces would wait for the
// narrow stores that made it.
class Group {
 public:
  Group(const TransportContext& context, const PathLimits& limits, PathCounters& counters)
      : context_(context),
        limits_(limits),
        counters_(counters),
        environment_(context.lights.has_environment()) {}

  void run(std::span<PathSample> paths) {
    run_flat([&] { advance(paths); });
  }

 private:
  void advance(std::span<PathSample> paths) {
    for (std::size_t i = 0; i < paths.size(); ++i) {
      Walker& w = walkers_[i];
      std::construct_at(&w);
      w.out = &paths[i];
      w.path.origin = paths[i].ray.origin;
      w.path.direction = paths[i].ray.direction;
      w.path.t_max = paths[i].ray.t_max;
    }
    std::size_t alive = limits_.max_depth == 0 ? 0 : paths.size();
    for (std::size_t i = 0; i < alive; ++i) active_[i] = &walkers_[i];
    while (alive > 0) {
      for (std::size_t i = 0; i < alive; ++i)
        rays_[i] = {active_[i]->path.origin, active_[i]->path.direction, active_[i]->path.t_max};
      context_.tracer.intersect(std::span(rays_.data(), alive), hits_.data());
      counters_.rays += static_cast<long long>(alive);
      alive = keep([this](Walker& w, std::size_t i) { return arrive(w, hits_[i]); }, alive);
      for (std::size_t i = 0; i < alive; ++i) {
        prefetch_vertices(active_[i]->hit);
        if (environment_) context_.lights.go_on(active_[i]->light);
      }
      for (std::size_t i = 0; i < alive; ++i) locate(*active_[i]);
      connections_ = 0;
      alive = keep([this](Walker& w, std::size_t) { return scatter(w); }, alive);
      context_.tracer.occluded(std::span(shadow_rays_.data(), connections_), blocked_.data());
      for (std::size_t i = 0; i < connections_; ++i) {
        if (!blocked_[i]) pending_[i].out->radiance += pending_[i].contribution;
      }
      counters_.rays += static_cast<long long>(connections_);
    }
  }

  // Leaves out the first `count` active paths for which goes_on(path, place) is false; returns how many are left.
  template <typename Function>
  std::size_t keep(Function goes_on, std::size_t count) {
    std::size_t kept = 0;
    for (std::size_t i = 0; i < count; ++i) {
      Walker* const w = active_[i];
      active_[kept] = w;
      kept += goes_on(*w, i) ? 1 : 0;
    }
    return kept;
  }

  // Takes what the ray hit; false where it left the scene.
  bool arrive(Walker& w, const Hit& hit) {
    w.hit = hit;
    if (w.path.depth == 0 && context_.hides_emitters()) hide_emitters(w);
    if (!w.hit.valid()) {
      if (environment_) w.out->radiance += path_escape(context_, w.path, w.out->first.valid);
      return false;
    }
    prefetch_triangle(w.hit);
    if (environment_) w.light = begin_light(w.path.origin + w.path.direction * w.hit.t, w.out->rng);
    return true;
  }

  void hide_emitters(Walker& w) {
    int rays = 0;
    w.hit = behind_emitters(context_, w.out->ray, w.hit, rays);
    counters_.rays += rays;
  }

  void prefetch_triangle(const Hit& hit) const {
    const Shape& shape = context_.scene.shapes[static_cast<std::size_t>(hit.shape)];
    if (shape.kind != Shape::Kind::mesh) return;
    const TriangleMesh& mesh = context_.scene.meshes[static_cast<std::size_t>(shape.geometry)];
    prefetch_line(mesh.triangles.data() + hit.primitive);
  }

  void prefetch_vertices(const Hit& hit) const {
    const Shape& shape = context_.scene.shapes[static_cast<std::size_t>(hit.shape)];
    if (shape.kind != Shape::Kind::mesh) return;
    const MeshView mesh = mesh_view(context_.scene.meshes[static_cast<std::size_t>(shape.geometry)]);
    const Vec3i t = mesh.triangles[hit.primitive];
    for (const int vertex : {t.x, t.y, t.z}) {
      prefetch_line(mesh.positions + vertex);
      if (mesh.normals != nullptr) prefetch_line(mesh.normals + vertex);
      if (mesh.uvs != nullptr) prefetch_line(mesh.uvs + vertex);
    }
  }

  // Environments are sampled from tables that do not fit into caches: their random numbers are drawn early.
  Lights::Draw begin_light(Vec3f x, Rng& rng) const {
    const LightNumbers numbers = draw_light_numbers(rng);
    return context_.lights.begin(x, numbers.u_pick, numbers.u);
  }

  void locate(Walker& w) {
    std::construct_at(&w.surface, context_.interact(w.hit, w.path.origin, w.path.direction));
    context_.materials.prefetch(w.surface.material, w.surface.uv);
  }

  bool scatter(Walker& w) {
    PathSample& out = *w.out;
    const auto connect = [&](const RayQuery& ray, Vec3f contribution) {
      std::construct_at(&shadow_rays_[connections_], ray);
      std::construct_at(&pending_[connections_++], PendingConnection{&out, contribution});
    };
    const auto sample_light = [&](Vec3f x, Rng& rng) {
      return environment_ ? context_.lights.finish(w.light, x) : sample_light_of_path(context_, {}, x, rng);
    };
    return path_scatter(context_, limits_, w.surface, w.hit.t, sample_light, w.path, out.rng, out.radiance, out.first,
                        connect);
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
  std::array<PendingConnection, kGroup> pending_;
  std::size_t connections_ = 0;
};

}  // namespace

void trace_paths(const TransportContext& context, const PathLimits& limits, std::span<PathSample> paths,
                 PathCounters& counters) {
  Group group(context, limits, counters);
  for (std::size_t i = 0; i < paths.size(); i += kGroup)
    group.run(paths.subspan(i, std::min(kGroup, paths.size() - i)));
}

}  // namespace octrad
