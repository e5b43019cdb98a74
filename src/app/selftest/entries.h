// Entries of the lists in checks.cc and benchmarks.cc that have a file of their own.
#pragma once

#include "app/cli/loaded_scene.h"
#include "app/selftest/selftest.h"

namespace octrad::selftest {

// field.cc: look-ups of features.
CheckResult check_lookup_floats(const Context& context);
CheckResult check_lookup_halves(const Context& context);
BenchmarkResult benchmark_lookup(const Context& context);          // queries in random order
BenchmarkResult benchmark_lookup_sorted(const Context& context);   // in Morton order: what sorting would be worth

// network.cc: the decoder's network, 45 -> 4 x 128 -> 3.
CheckResult check_decoder(const Context& context);
BenchmarkResult benchmark_decoder(const Context& context);
BenchmarkResult benchmark_decoder_training(const Context& context);

// shading.cc: materials and lights at the ends of rays. Needs Context::loaded.
CheckResult check_shading(const Context& context);

// room.cc. A closed room with a lamp, coloured walls and two balls of rough metal: for stages without a scene file.
cli::LoadedScene built_in_room();

// benchmarks.cc. Median of several runs after a warm one, by the stream's own clock. `count`: what one run does.
BenchmarkResult measure(const Context& context, double count, const std::string& unit, const std::function<void()>& work);

}  // namespace octrad::selftest
