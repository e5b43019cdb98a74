#include "octrad/device/checks.h"
#include "app/selftest/entries.h"
#include "app/selftest/selftest.h"
#include "octrad/network/checks.h"

namespace octrad::selftest {

namespace {

CheckResult check_lookup(const Context& c, bool halves) {
  OctaOctree tree = make_octree(c.scene, 5);
  const LookupQueries queries = surface_queries(c, c.items(1 << 16, 1 << 12), false);
  return check_octree_lookup(c.stream, tree, queries, halves, c.seed + 1);
}

CheckResult check_hash_grid(const Context& c) {
  HashGrid grid(HashGridOptions{4, 2, 16, 16, 4.0});
  const LookupQueries queries = surface_queries(c, c.items(1 << 18, 1 << 14), false);
  return check_hash_grid_lookup(c.stream, grid, c.scene.bounds.lower, c.scene.bounds.extent(), queries, false, c.seed);
}

constexpr Check kChecks[] = {
    {"random numbers",
     [](const Context& c) { return check_random_numbers(c.stream, c.items(1 << 20, 1 << 16), c.seed); }},
    {"Sobol points", [](const Context& c) { return check_sobol(c.stream, 1 << 16); }},
    {"atomics", [](const Context& c) { return check_atomics(c.stream, c.items(1 << 22, 1 << 17), c.seed); }},
    {"sort", [](const Context& c) { return check_sort(c.stream, c.items(1 << 21, 1 << 16), 20, c.seed); }},
    {"scan", [](const Context& c) { return check_scan(c.stream, c.items(1 << 21, 1 << 16), c.seed); }},
    {"sum", [](const Context& c) { return check_sum(c.stream, c.items(1 << 22, 1 << 17), c.seed); }},
    {"octahedral map",
     [](const Context& c) { return check_octahedral_map(c.stream, c.items(1 << 20, 1 << 16), c.seed); }},
    {"spherical harmonics",
     [](const Context& c) { return check_spherical_harmonics(c.stream, c.items(1 << 18, 1 << 14), c.seed); }},
    {"hash grid", check_hash_grid},
    {"Adam", [](const Context& c) { return check_adam_update(c.stream, c.items(1 << 20, 1 << 15), c.seed); }},
    {"closest hit, Embree", check_closest_embree},
    {"closest hit, same tree on the CPU", check_closest_cpu},
    {"closest hit, a thread a ray", check_closest_alone},
    {"occlusion, Embree", check_occluded},
    {"occlusion, a thread a ray", check_occluded_alone},
    {"feature lookup, floats", [](const Context& c) { return check_lookup(c, false); }},
    {"feature lookup, halves", [](const Context& c) { return check_lookup(c, true); }},
    {"decoder",
     [](const Context& c) { return check_mlp_forward(c.stream, kDecoder, c.items(1 << 16, 1 << 11), c.seed); }},
    {"optimiser, network",
     [](const Context& c) { return check_dense_adam(c.stream, c.items(1 << 20, 1 << 15), c.seed); }},
    {"optimiser, table of touched entries",
     [](const Context& c) { return check_table_adam(c.stream, c.items(1 << 16, 1 << 10), false, c.seed); }},
    {"optimiser, dense table",
     [](const Context& c) { return check_table_adam(c.stream, c.items(1 << 16, 1 << 10), true, c.seed); }},
    {"materials and lights", check_shading, true},
    {"left-hand-side points", check_left_hand_sides},
    {"right-hand sides", check_right_hand_sides},
    {"first hits", check_first_hits},
    {"paths", check_paths},
    {"paths, a thread each", check_long_paths},
    {"film", check_film},
};

}  // namespace

std::span<const Check> checks() { return kChecks; }

}  // namespace octrad::selftest
