// Entries of the lists in checks.cc and benchmarks.cc that have a file of their own.
#pragma once

#include "app/selftest/selftest.h"
#include "octrad/encoding/checks.h"
#include "octrad/network/checks.h"

namespace octrad::selftest {

// field.cc: look-ups of features.
OctaOctree make_octree(const Scene& scene, int levels);
// On the scene's surfaces. `sorted`: neighbours in space are neighbours in memory, by cells of a grid of 32^3 in Morton
// order.
LookupQueries surface_queries(const Context& context, std::size_t n, bool sorted);
BenchmarkResult benchmark_lookup(const Context& context);         // queries in random order
BenchmarkResult benchmark_lookup_sorted(const Context& context);  // in Morton order: what sorting would be worth

// network.cc: the decoder's network, 45 -> 4 x 128 -> 3.
inline constexpr MlpShape kDecoder{45, 128, 4, 3};
BenchmarkResult benchmark_decoder(const Context& context);
BenchmarkResult benchmark_decoder_training(const Context& context);

// shading.cc: materials and lights at the ends of rays. Needs Context::loaded.
CheckResult check_shading(const Context& context);

// rays.cc: warps that take rays (transport/cast.h), against Embree and against the same tree on the CPU; and the walk
// of a thread alone, which chains, the ends of long paths and traced disparities take.
CheckResult check_closest_embree(const Context& context);
CheckResult check_closest_cpu(const Context& context);
CheckResult check_occluded(const Context& context);
CheckResult check_closest_alone(const Context& context);
CheckResult check_occluded_alone(const Context& context);

// transport.cc: what trains and renders, item by item. On the scene given, else in varied_room().
CheckResult check_left_hand_sides(const Context& context);
CheckResult check_right_hand_sides(const Context& context);
CheckResult check_first_hits(const Context& context);
CheckResult check_paths(const Context& context);
CheckResult check_long_paths(const Context& context);
// film.cc
CheckResult check_film(const Context& context);

// room.cc. For stages without a scene file: a closed room with a lamp, coloured walls and two balls of rough metal.
PreparedScene built_in_room();
// For checks without one: open to a sky, with a glossy floor, a one-sided wall, glass, a mirror, a curtain that lets
// half of the light pass, and two lamps.
PreparedScene varied_room();

// benchmarks.cc. Median of several runs after a warm one, by the stream's own clock. `count`: what one run does.
BenchmarkResult measure(const Context& context, double count, const std::string& unit,
                        const std::function<void()>& work);

}  // namespace octrad::selftest
