#include <algorithm>

#include "app/selftest/selftest.h"
#include "octrad/base/morton.h"
#include "octrad/base/rng.h"
#include "octrad/device/checks.h"
#include "octrad/geometry/voxelize.h"
#include "octrad/network/checks.h"
#include "octrad/render/checks.h"
#include "octrad/transport/checks.h"

namespace octrad::selftest {

OctaOctree make_octree(const Context& c, int levels) {
  const Domain domain = scene_domain(c.soup.scene().bounds, true);
  return OctaOctree({levels, 4}, occupied_cells(c.soup.scene(), domain, levels), domain.origin, domain.size);
}

LookupQueries surface_queries(const Context& c, std::size_t n, bool sorted) {
  const Domain domain = scene_domain(c.soup.scene().bounds, true);
  std::vector<Vec3f> positions(n);
  for (std::size_t i = 0; i < n; ++i) {
    Rng rng(c.seed, RngPurpose::test, i);
    const float pick = rng.uniform();
    positions[i] = c.soup.surfaces().sample_position(pick, rng.uniform2());
  }
  const auto key = [&](Vec3f p) {
    const Vec3f cell = (p - domain.origin) / domain.size * 32.0f;
    return morton_code({static_cast<int>(cell.x), static_cast<int>(cell.y), static_cast<int>(cell.z)});
  };
  if (sorted) std::ranges::stable_sort(positions, {}, key);
  return LookupQueries(c.stream, positions, 4.0f / length(c.soup.scene().bounds.extent()), c.seed + 2);
}

namespace {

using Traversal = RayBatch::Traversal;
using Bounce = FirstHitOptions::Bounce;

CheckResult check_hash_grid(const Context& c) {
  HashGrid grid(HashGridOptions{4, 2, 16, 16, 4.0});
  const auto& bounds = c.soup.scene().bounds;
  return check_hash_grid_lookup(c.stream, grid, bounds.lower, bounds.extent(),
                                surface_queries(c, c.items(1 << 18, 1 << 14)), false, c.seed);
}

CheckResult check_prefiltered(const Context& c) {
  HashGrid grid(HashGridOptions{8, 8, c.large() ? 19 : 12, 4, 2.0});
  const Domain domain = scene_domain(c.soup.scene().bounds, true);
  const LookupQueries queries = surface_queries(c, c.items(1 << 18, 1 << 12));
  std::vector<Vec3f> p;
  for (std::size_t i = 0; i < queries.n; ++i) p.push_back((queries.position(i) - domain.origin) / domain.size);
  return check_prefiltered_lookup(c.stream, grid, p, true, c.seed);
}

CheckResult check_lookup(const Context& c, bool halves) {
  OctaOctree tree = make_octree(c, 5);
  return check_octree_lookup(c.stream, tree, surface_queries(c, c.items(1 << 16, 1 << 12)), halves, c.seed + 1);
}

CheckResult check_hits(const Context& c, Traversal traversal, const Tracer* other = nullptr) {
  const std::vector<RayQuery> rays = incoherent_rays(c.soup, c.items(1 << 20, 1 << 15), false, c.seed);
  return check_closest(c.stream, c.soup, rays, traversal, other);
}

CheckResult check_shadows(const Context& c, Traversal traversal, const Tracer* other = nullptr) {
  const std::vector<RayQuery> rays = incoherent_rays(c.soup, c.items(1 << 20, 1 << 15), true, c.seed);
  return check_occluded(c.stream, c.soup, rays, traversal, other);
}

CheckResult check_lhs(const Context& c) {
  LhsOptions options;
  options.walks = 0.6;
  options.view = 0.2;
  options.keep_direction = 0.3;
  options.uniform_glossy = true;
  options.glossy_boost = 2.0;
  options.seed = c.seed;
  return check_left_hand_sides(c.stream, c.open, options, c.items(1 << 15, 1 << 10), c.seed % 1000 * 2, 2);
}

CheckResult check_clusters(const Context& c) {
  QueryRays rays;
  rays.lobe = c.large() ? 128 : 32;
  rays.lobe_below = 0.5f;
  rays.iterations = 10;
  return check_lobes(c.stream, c.open, c.items(1 << 14, 1 << 9), rays, c.seed);
}

CheckResult check_rhs(const Context& c) {
  constexpr RhsCase kCases[] = {{16, false, false, false, true, true},
                                {5, true, true, true, true, false, 0.3f},
                                {4, false, false, false, false},
                                {8, false, false, false, true, false, 0.3f},
                                {8, false, false, false, true, false, 0.3f, true, true}};
  return check_right_hand_sides(c.stream, c.open, kCases, c.items(1 << 13, 1 << 8), c.seed);
}

CameraJob small_picture(const Context& c, int count) {
  CameraJob job = camera_job(c.open, c.large() ? 256 : 32, c.large() ? 192 : 24, count, c.seed);
  job.first = 3;
  return job;
}

CheckResult check_g_buffer(const Context& c) {
  std::vector<FirstHitCase> cases;
  for (const Bounce bounce : {Bounce::none, Bounce::glossy, Bounce::all}) {
    FirstHitOptions options;
    options.follow_below = bounce == Bounce::none ? 0.0f : bounce == Bounce::glossy ? kFollowDelta : 0.3f;
    options.bounce = bounce;
    options.emission_inside = bounce == Bounce::glossy;
    options.max_chain = 6;
    options.split_coats = bounce == Bounce::none;
    cases.push_back({options, bounce != Bounce::all, bounce == Bounce::none});
  }
  cases.push_back(cases.front());
  cases.back().options.follow_below = kFollowDelta;
  cases.back().options.coat_samples = cases.back().options.metal_samples = 20.0f;
  return check_first_hits(c.stream, c.open, small_picture(c, 3), cases);
}

CheckResult check_path_tracer(const Context& c, int wave_bounces) {
  const CameraJob job = small_picture(c, 4);
  constexpr PathLimits kLimits{12, 5};
  return check_paths(c.stream, c.open, {&job, 1}, {&kLimits, 1}, wave_bounces);
}

// Sizes on a device, and on the host.
constexpr Check kChecks[] = {
    {"random numbers",
     [](const Context& c) { return check_random_numbers(c.stream, c.items(1 << 20, 1 << 16), c.seed); }},
    {"Sobol points", [](const Context& c) { return check_sobol(c.stream, 1 << 16); }},
    {"atomics", [](const Context& c) { return check_atomics(c.stream, c.items(1 << 22, 1 << 17), c.seed); }},
    {"appended lists", [](const Context& c) { return check_appends(c.stream, c.items(1 << 22, 1 << 17), c.seed); }},
    {"sort", [](const Context& c) { return check_sort(c.stream, c.items(1 << 21, 1 << 16), 20, c.seed); }},
    {"scan", [](const Context& c) { return check_scan(c.stream, c.items(1 << 21, 1 << 16), c.seed); }},
    {"sum", [](const Context& c) { return check_sum(c.stream, c.items(1 << 22, 1 << 17), c.seed); }},
    {"octahedral map",
     [](const Context& c) { return check_octahedral_map(c.stream, c.items(1 << 20, 1 << 16), c.seed); }},
    {"spherical harmonics",
     [](const Context& c) { return check_spherical_harmonics(c.stream, c.items(1 << 18, 1 << 14), c.seed); }},
    {"hash grid", check_hash_grid},
    {"prefiltered grid", check_prefiltered},
    {"Adam", [](const Context& c) { return check_adam_update(c.stream, c.items(1 << 20, 1 << 15), c.seed); }},
    {"closest hit, Embree",
     [](const Context& c) { return check_hits(c, Traversal::warps, make_embree_tracer(c.soup.scene()).get()); }},
    {"closest hit, same tree on the CPU", [](const Context& c) { return check_hits(c, Traversal::warps); }},
    {"closest hit, a thread a ray", [](const Context& c) { return check_hits(c, Traversal::threads); }},
    {"occlusion, Embree",
     [](const Context& c) { return check_shadows(c, Traversal::warps, make_embree_tracer(c.soup.scene()).get()); }},
    {"occlusion, a thread a ray", [](const Context& c) { return check_shadows(c, Traversal::threads); }},
    {"feature lookup, floats", [](const Context& c) { return check_lookup(c, false); }},
    {"feature lookup, halves", [](const Context& c) { return check_lookup(c, true); }},
    {"decoder",
     [](const Context& c) { return check_mlp_forward(c.stream, kDecoder, c.items(1 << 16, 1 << 11), c.seed); }},
    {"optimiser, network",
     [](const Context& c) { return check_dense_adam(c.stream, c.items(1 << 20, 1 << 15), c.seed); }},
    {"optimiser, table of touched entries",
     [](const Context& c) {
       return check_table_adam(c.stream, c.items(1 << 16, 1 << 10), TableMode::touched, c.seed);
     }},
    {"optimiser, dense table",
     [](const Context& c) { return check_table_adam(c.stream, c.items(1 << 16, 1 << 10), TableMode::dense, c.seed); }},
    {"optimiser, dense table, half moments",
     [](const Context& c) {
       return check_table_adam(c.stream, c.items(1 << 16, 1 << 10), TableMode::dense_half_moments, c.seed);
     }},
    {"materials and lights",
     [](const Context& c) { return check_world(c.stream, c.materials, c.items(1 << 18, 1 << 13), c.seed); }},
    {"left-hand-side points", check_lhs},
    {"clusters of hits", check_clusters},
    {"right-hand sides", check_rhs},
    {"first hits", check_g_buffer},
    {"paths", [](const Context& c) { return check_path_tracer(c, 16); }},
    {"paths, a thread each", [](const Context& c) { return check_path_tracer(c, 2); }},  // but the first vertices
    {"film",
     [](const Context& c) {
       const int size = c.large() ? 512 : 48;
       return check_film(c.stream, size, size, size / 4, c.seed);
     }},
};

}  // namespace

std::span<const Check> checks() { return kChecks; }

}  // namespace octrad::selftest
