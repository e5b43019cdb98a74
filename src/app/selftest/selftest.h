// What octrad selftest runs: checks of kernels against the CPU's definitions, micro-benchmarks, and whole stages. Three
// lists, each in its own file; a new entry is a function and a line of the list.
#pragma once

#include <cstdint>
#include <functional>
#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "octrad/device/check.h"
#include "octrad/device/stream.h"
#include "octrad/transport/prepared_scene.h"

namespace octrad::selftest {

// What entries work on.
struct Context {
  Stream& stream;
  std::uint64_t seed;
  const Scene& scene;    // geometry; materials and lights only where `loaded` is not null
  const Tracer& tracer;  // Embree
  const Bvh8& bvh;
  const PreparedScene* loaded = nullptr;  // the scene that the user gave
  bool quick = false;                     // small sizes on a device too

  // A size for a device, or a small one for the host and for quick runs.
  std::size_t items(std::size_t device, std::size_t host) const { return stream.on_device() && !quick ? device : host; }
};

// ---- Checks (checks.cc)

using Errors = CheckErrors;

struct Check {
  const char* name;
  CheckResult (*run)(const Context&);
  bool needs_scene = false;  // one with materials: Context::loaded
};
std::span<const Check> checks();

// ---- Micro-benchmarks (benchmarks.cc)

struct BenchmarkResult {
  double rate = 0.0;  // of the median run
  std::string unit;   // "rays/s"
  double median_ms = 0.0, min_ms = 0.0, max_ms = 0.0;
  int runs = 0;
  std::vector<std::pair<std::string, double>> sizes;
};

struct Benchmark {
  const char* name;
  BenchmarkResult (*run)(const Context&);
  const char* missing = nullptr;  // why there is nothing to run yet; run is null then
};
std::span<const Benchmark> benchmarks();

// ---- Stages (stages.cc): a short training and a frame, against the CPU's. On the scene given, else in a room that is
// built in.

struct StageResult {
  nlohmann::json report;
  std::string summary;  // one line
  bool passed = false;
};

struct Stage {
  const char* name;
  StageResult (*run)(const Context&);
};
std::span<const Stage> stages();

// A closed room with a soup of triangles and spheres in it: for checks without a scene file.
Scene built_in_scene(std::uint64_t seed);
// Rays between surfaces: uniform points, uniform directions, off the surface as everywhere. t_max: 1e30.
std::vector<RayQuery> incoherent_rays(const Scene& scene, std::size_t n, std::uint64_t seed);

}  // namespace octrad::selftest
