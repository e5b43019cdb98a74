// Queries of every field a second, on all threads, at points of a scene as a renderer asks them: what the field wants
// traced from the points, its evaluation, and both. Glossy points are those with the costly part of field ncr. Needs
// the shared scenes (OCTRAD_SHARED); the scene is OCTRAD_BENCH_SCENE, else kitchen. Sizes are those of
// OCTRAD_BENCH_PRESET, else default.
//   bench_train --benchmark_filter=ncr/glossy
#include <benchmark/benchmark.h>

#include <cstdlib>

#include "octrad/base/threads.h"
#include "octrad/scene/files_test_helper.h"
#include "octrad/scene/load.h"
#include "octrad/train/trainer.h"
#include "octrad/transport/query_point.h"

namespace octrad {
namespace {

constexpr std::size_t kPoints = std::size_t{1} << 14, kBlock = 256;

std::string from_environment(const char* name, const char* otherwise) {
  const char* given = std::getenv(name);
  return given != nullptr ? given : otherwise;
}

const PreparedScene* bench_scene() {
  static const auto scene = [] {
    const auto file = shared_folder() / "scenes" / from_environment("OCTRAD_BENCH_SCENE", "kitchen") / "scene.xml";
    return std::filesystem::exists(file) ? std::make_unique<PreparedScene>(load_scene(file.string())) : nullptr;
  }();
  return scene.get();
}

// On glossy surfaces, or on rough ones, seen from uniform directions.
std::vector<ShadingPoint> shading_points(const PreparedScene& scene, bool glossy) {
  const TransportContext context = scene.context();
  std::vector<ShadingPoint> points;
  for (std::uint64_t i = 0; points.size() < kPoints && i < 1000 * kPoints; ++i) {
    Rng rng(1, RngPurpose::test, i);
    const float pick = rng.uniform();
    const SurfaceInteraction surface = scene.surfaces().sample(pick, rng.uniform2());
    Vec3f wo = uniform_direction(rng.uniform2());
    if (dot(wo, surface.geometric_normal) < 0.0f) wo = -wo;
    const ShadingPoint point = context.shade(surface, wo);
    if (!point.black && (roughness_bsdf(point.bsdf) < 0.5f) == glossy) points.push_back(point);
  }
  return points;
}

enum class Part { rays, field, both };

void query(benchmark::State& state, const std::string& name, bool glossy, Part part) {
  const PreparedScene* scene = bench_scene();
  if (scene == nullptr) return state.SkipWithError("OCTRAD_SHARED has no such scene");
  Config config = preset(from_environment("OCTRAD_BENCH_PRESET", "default"));
  config.field = name;
  config.octree_levels = 6;  // memory
  const auto field = make_field(config, field_domain(scene->scene(), config, fit_domain(*scene, config).box));
  const TransportContext context = scene->context();
  const QueryRays rays = query_rays(config);
  const std::vector<ShadingPoint> shading = shading_points(*scene, glossy);
  if (shading.empty()) return state.SkipWithError("no such surfaces");
  std::vector<SurfacePoint> points(shading.size());
  std::vector<Vec3f> out(shading.size());
  const auto run = [&](bool trace, bool evaluate) {
    parallel_blocks(points.size(), kBlock, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; trace && i < end; ++i) {
        Rng rng(2, RngPurpose::test, i);
        points[i] = field_query_point(context, shading[i], rays, rng);
      }
      if (evaluate)
        field->radiance(std::span(points).subspan(begin, end - begin), std::span(out).subspan(begin, end - begin));
    });
  };
  run(true, true);
  for (auto _ : state) run(part != Part::field, part != Part::rays);
  state.counters["queries"] = benchmark::Counter(
      static_cast<double>(state.iterations()) * static_cast<double>(points.size()), benchmark::Counter::kIsRate);
}

const int registered = [] {
  for (const std::string& field : field_names()) {
    for (const bool glossy : {true, false}) {
      for (const auto& [what, part] : {std::pair{"rays", Part::rays}, {"field", Part::field}, {"both", Part::both}}) {
        benchmark::RegisterBenchmark((field + (glossy ? "/glossy/" : "/rough/") + what).c_str(),
                                     [=, part = part](benchmark::State& state) { query(state, field, glossy, part); })
            ->UseRealTime()
            ->Unit(benchmark::kMillisecond);
      }
    }
  }
  return 0;
}();

}  // namespace
}  // namespace octrad
