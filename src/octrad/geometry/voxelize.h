// Which cells of a regular grid hold surfaces (method section 3).
#pragma once

#include <cstdint>
#include <vector>

#include "octrad/scene/scene.h"

namespace octrad {

// Box of the octree: position p maps to (p - origin) / size in the unit cube.
struct Domain {
  Vec3f origin, size;
};

// `bounds` padded by 0.01 world units on every side; with `cube` by at most 1 % of the largest side, and then the cube
// of the largest side around the same centre.
Domain scene_domain(const Bounds3f& bounds, bool cube);

// Non-empty cells of levels l = 1..levels (2^(l+1) cells an axis), result[l - 1] in Morton order. At the finest level a
// cell is non-empty when its closed box meets a triangle or a sphere's surface (separating axes, Akenine-Moeller 2001;
// grown by 1e-4 of a cell so that rounding leaves no holes); its parents follow. Surfaces outside the domain belong to
// the cells of its rim that are nearest to them, where OctaOctree looks them up. Parallel, deterministic. levels in
// 1..9.
//
// A small file can place very many surfaces that each meet many cells. Throws InputError where all of them together may
// take more than `most_tests` tests against cells, and 256 for each triangle and sphere that the scene holds: a few ten
// seconds of a processor. Each that is placed counts as one test at least.
std::vector<std::vector<Vec3i>> occupied_cells(const Scene& scene, const Domain& domain, int levels,
                                               std::uint64_t most_tests = 500'000'000);

// The paper's alternative: cells that hold at least one of `samples` area-uniform surface samples at the finest level.
std::vector<std::vector<Vec3i>> sampled_cells(const Scene& scene, const Domain& domain, int levels, std::uint64_t seed,
                                              std::uint64_t samples = std::uint64_t{1} << 26);

// Whether the closed box [lower, upper] meets the triangle; for tests and for the voxelisation.
bool overlaps(Vec3d lower, Vec3d upper, Vec3d a, Vec3d b, Vec3d c);

}  // namespace octrad
