// What octrad selftest runs: the checks of kernels that the modules offer (MODULE/checks.h) at the sizes of a device,
// micro-benchmarks, and whole stages. Three lists, each in its own file; a new entry is a line of the list.
#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "octrad/device/check.h"
#include "octrad/device/stage_times.h"
#include "octrad/encoding/checks.h"
#include "octrad/network/mlp.h"
#include "octrad/transport/prepared_scene.h"

namespace octrad::selftest {

// What entries work on. The scenes are all the one that the user gave, else built-in ones. The CPU traverses the tree
// that devices traverse; rays are compared with Embree's by checks of their own.
struct Context {
  Stream& stream;
  std::uint64_t seed;
  bool quick;                      // small sizes on a device too
  const PreparedScene& soup;       // for rays and look-ups: testing::triangle_soup()
  const PreparedScene& materials;  // testing::every_material()
  const PreparedScene& open;       // for estimators: testing::open_room()
  const PreparedScene& closed;     // for stages: testing::closed_room()

  bool large() const { return stream.on_device() && !quick; }
  // A size for a device, or a small one for the host and for quick runs.
  std::size_t items(std::size_t device, std::size_t host) const { return large() ? device : host; }
};

// ---- Checks (checks.cc)

struct Check {
  const char* name;
  CheckResult (*run)(const Context&);
};
std::span<const Check> checks();

// An octree of features for the scene of rays, and queries on its surfaces. `sorted`: neighbours in space are
// neighbours in memory, by cells of a grid of 32^3 in Morton order, as a sort of 15-bit keys would have them.
OctaOctree make_octree(const Context& context, int levels);
LookupQueries surface_queries(const Context& context, std::size_t n, bool sorted = false);

inline constexpr MlpShape kDecoder{45, 128, 4, 3};  // the decoder's network

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
};
std::span<const Benchmark> benchmarks();

// ---- Stages (stages.cc): a short training and a frame, against the CPU's.

struct StageResult {
  nlohmann::json report;
  std::string summary;  // one line
  StageSplit stages;    // of the stream's work, in milliseconds
  bool passed = false;
};

struct Stage {
  const char* name;
  StageResult (*run)(const Context&);
};
std::span<const Stage> stages();

}  // namespace octrad::selftest
