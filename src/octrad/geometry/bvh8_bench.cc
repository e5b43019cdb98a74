// The 8-wide tree against Embree: time to build, rays a second, one at a time. Needs the shared scenes (OCTRAD_SHARED);
// the scene is OCTRAD_BENCH_SCENE, else kitchen.
//   bench_geometry --benchmark_filter=trace
#include <benchmark/benchmark.h>

#include <cstdlib>

#include "octrad/base/rng.h"
#include "octrad/geometry/bvh8.h"
#include "octrad/geometry/surface_sampling.h"
#include "octrad/scene/files_test_helper.h"
#include "octrad/scene/load.h"

namespace octrad {
namespace {

struct Fixture {
  Scene scene;
  std::vector<RayQuery> rays;  // from surface to surface, directions uniform
  Fixture() {
    const char* given = std::getenv("OCTRAD_BENCH_SCENE");
    const std::filesystem::path file = shared_folder() / "scenes" / (given ? given : "kitchen") / "scene.xml";
    if (!std::filesystem::exists(file)) return;
    scene = load_scene(file.string());
    const SurfaceSampler sampler(scene);
    Rng rng(1, RngPurpose::test, 0);
    for (int i = 0; i < 1 << 16; ++i) {
      const SurfaceInteraction s = sampler.sample(rng.uniform(), rng.uniform2());
      const Vec3f d = uniform_direction(rng.uniform2());
      rays.push_back({offset_origin(s.position, s.geometric_normal, d), d, 1e30f});
    }
  }
};

const Fixture& fixture() {
  static const Fixture f;
  return f;
}

void build(benchmark::State& state, bool embree) {
  if (fixture().rays.empty()) return state.SkipWithError("no shared scenes");
  const Scene& scene = fixture().scene;
  Bvh8 bvh;
  for (auto _ : state) {
    if (embree) {
      benchmark::DoNotOptimize(make_embree_tracer(scene));
    } else {
      bvh = build_bvh8(scene);
    }
  }
  state.counters["triangles"] = static_cast<double>(scene.triangle_count());
  if (embree) return;
  state.counters["nodes"] = static_cast<double>(bvh.nodes.size());
  state.counters["levels"] = bvh.levels;
  state.counters["cost"] = bvh.cost;
  state.counters["MB"] = static_cast<double>(bvh.bytes()) * 1e-6;
}

void trace(benchmark::State& state, bool embree, bool occlusion) {
  if (fixture().rays.empty()) return state.SkipWithError("no shared scenes");
  const auto tracer = embree ? make_embree_tracer(fixture().scene) : make_bvh8_tracer(fixture().scene);
  std::size_t i = 0;
  for (auto _ : state) {
    const RayQuery& r = fixture().rays[i++ & 0xffff];
    if (occlusion) {
      benchmark::DoNotOptimize(tracer->occluded(r.origin, r.direction, 0.0f, r.t_max));
    } else {
      benchmark::DoNotOptimize(tracer->intersect(r.origin, r.direction, 0.0f, r.t_max));
    }
  }
  state.counters["Mrays/s"] =
      benchmark::Counter(static_cast<double>(state.iterations()) * 1e-6, benchmark::Counter::kIsRate);
}

BENCHMARK_CAPTURE(build, bvh8, false)
    ->Unit(benchmark::kMillisecond)
    ->MeasureProcessCPUTime()
    ->UseRealTime()
    ->Iterations(3);
BENCHMARK_CAPTURE(build, embree, true)
    ->Unit(benchmark::kMillisecond)
    ->MeasureProcessCPUTime()
    ->UseRealTime()
    ->Iterations(2);
BENCHMARK_CAPTURE(trace, bvh8_closest, false, false);
BENCHMARK_CAPTURE(trace, embree_closest, true, false);
BENCHMARK_CAPTURE(trace, bvh8_occluded, false, true);
BENCHMARK_CAPTURE(trace, embree_occluded, true, true);

}  // namespace
}  // namespace octrad
