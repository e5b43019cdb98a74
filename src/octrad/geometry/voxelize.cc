#include "octrad/geometry/voxelize.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <string>

#include "octrad/base/error.h"
#include "octrad/base/memory_limit.h"
#include "octrad/base/morton.h"
#include "octrad/base/rng.h"
#include "octrad/base/threads.h"
#include "octrad/geometry/primitives.h"
#include "octrad/geometry/shape_view.h"
#include "octrad/geometry/surface_sampling.h"

namespace octrad {
namespace {

constexpr double kGrow = 1e-4;  // of a cell: rounding of positions to float must not open holes

// One bit a cell of the finest level, set from several threads; the result does not depend on their order.
class Bits {
 public:
  // `scene`: the file that messages name.
  Bits(int resolution, const std::string& scene)
      : n_(static_cast<std::uint64_t>(resolution)),
        what_(scene + ": the grid of the octree's cells") {
    const std::uint64_t words = (n_ * n_ * n_ + 63) / 64;
    ask_memory(words * sizeof(std::uint64_t), what_);
    words_.resize(words);
  }
  void set(Vec3i c) {
    const std::uint64_t code = morton_code(c);
    set_word(code, std::uint64_t{1} << (code & 63));
  }
  // Of the 4 x 4 x 4 cells around the one with this code.
  std::uint64_t word(std::uint64_t code) {
    return std::atomic_ref<std::uint64_t>(words_[code >> 6]).load(std::memory_order_relaxed);
  }
  void set_word(std::uint64_t code, std::uint64_t cells) {
    if (cells & ~word(code))
      std::atomic_ref<std::uint64_t>(words_[code >> 6]).fetch_or(cells, std::memory_order_relaxed);
  }
  // Set cells in Morton order.
  std::vector<std::uint64_t> codes() const {
    std::uint64_t count = 0;
    for (const std::uint64_t word : words_) count += static_cast<std::uint64_t>(__builtin_popcountll(word));
    ask_memory(count * (sizeof(std::uint64_t) + sizeof(Vec3i) * 8 / 7), what_);  // 1 + 1/8 + 1/64 + ...
    std::vector<std::uint64_t> result;
    result.reserve(count);
    for (std::size_t w = 0; w < words_.size(); ++w) {
      for (std::uint64_t rest = words_[w]; rest; rest &= rest - 1)
        result.push_back((w << 6) + static_cast<std::uint64_t>(__builtin_ctzll(rest)));
    }
    return result;
  }

 private:
  std::uint64_t n_;
  std::string what_;
  std::vector<std::uint64_t> words_;
};

// World positions in units of cells of the finest level.
struct Grid {
  Domain domain;
  int resolution;
  Vec3d cells(Vec3f p) const {
    return (Vec3d(p) - Vec3d(domain.origin)) / Vec3d(domain.size) * static_cast<double>(resolution);
  }
  int clamp(double v) const {
    return static_cast<int>(std::clamp(std::floor(v), 0.0, static_cast<double>(resolution - 1)));
  }
  Vec3i cell(Vec3d p) const { return {clamp(p.x), clamp(p.y), clamp(p.z)}; }
  // Cubes of cells on the rim also hold what lies outside the domain beside them: positions there are moved to them.
  bool on_rim(Vec3i at, int size) const { return min_component(at) == 0 || max_component(at) + size == resolution; }
};

// Blocks of 4 x 4 x 4 cells, a word of Bits each, are visited whose box the range of cells [low, high] touches and that
// may meet the surface: `meets(lower, size)` says so of a cube of `size` cells and is never wrong about one that does.
// What is large is found through cubes that become smaller, so that the time goes with the surface, not with its box.
template <typename Meets, typename Visit>
void visit_blocks(Vec3i lower, int size, Vec3i low, Vec3i high, std::uint64_t& tests, const Meets& meets,
                  const Visit& visit) {
  for (int i = 0; i < 3; ++i) {
    if (lower[i] > high[i] || lower[i] + size <= low[i]) return;
  }
  ++tests;
  if (!meets(lower, size)) return;
  if (size == 4) return visit(lower);
  for (int child = 0; child < 8; ++child) {
    const Vec3i at{child & 1, child >> 1 & 1, child >> 2};
    visit_blocks(lower + at * (size / 2), size / 2, low, high, tests, meets, visit);
  }
}

// Sets the cells of [low, high] for which cell(x, y, z) holds, where `meets` (visit_blocks) does not exclude them.
// Returns the most questions to both that this can take, whatever is marked already.
template <typename Meets, typename Cell>
std::uint64_t mark_cells(const Grid& grid, Vec3i low, Vec3i high, Bits& bits, const Meets& meets, const Cell& cell) {
  std::uint64_t tests = 0;
  const auto mark_block = [&](Vec3i block) {
    const Vec3i cells = min(block + Vec3i{3, 3, 3}, high) - max(block, low) + Vec3i{1, 1, 1};
    tests += static_cast<std::uint64_t>(cells.x * cells.y * cells.z);
    const std::uint64_t code = morton_code(block);
    const std::uint64_t known = bits.word(code);
    if (known == ~std::uint64_t{0}) return;
    std::uint64_t found = 0;
    for (int z = std::max(block.z, low.z); z <= std::min(block.z + 3, high.z); ++z) {
      for (int y = std::max(block.y, low.y); y <= std::min(block.y + 3, high.y); ++y) {
        for (int x = std::max(block.x, low.x); x <= std::min(block.x + 3, high.x); ++x) {
          const std::uint64_t bit = std::uint64_t{1} << morton_code({x & 3, y & 3, z & 3});
          if (!(known & bit) && cell(x, y, z)) found |= bit;
        }
      }
    }
    bits.set_word(code, found);
  };
  const Vec3i first{low.x & ~3, low.y & ~3, low.z & ~3};
  if (max_component(high - first) >= 8) {
    visit_blocks(Vec3i{0, 0, 0}, grid.resolution, low, high, tests, meets, mark_block);
    return tests;
  }
  for (int z = first.z; z <= high.z; z += 4) {
    for (int y = first.y; y <= high.y; y += 4) {
      for (int x = first.x; x <= high.x; x += 4) mark_block({x, y, z});
    }
  }
  return tests;
}

// Returns what mark_cells() does.
std::uint64_t mark_triangle(const Grid& grid, Vec3d a, Vec3d b, Vec3d c, Bits& bits) {
  const Vec3d lower = min(min(a, b), c) - Vec3d(kGrow), upper = max(max(a, b), c) + Vec3d(kGrow);
  const Vec3i low = grid.cell(lower), high = grid.cell(upper);
  if (low == high) {
    bits.set(low);
    return 0;
  }
  const Vec3d n = cross(b - a, c - a);
  const double n_sum = std::abs(n.x) + std::abs(n.y) + std::abs(n.z), n_offset = dot(n, a);
  // The plane first: most cells of a large triangle's box fail there.
  const auto off_plane = [&](Vec3d corner, double size, double grow) {
    return std::abs(dot(n, corner + Vec3d(0.5 * size)) - n_offset) > n_sum * (0.5 * size + grow);
  };
  const bool inside = min_component(lower) >= 0.0 && max_component(upper) <= grid.resolution;
  const auto meets = [&](Vec3i at, int size, double grow) {
    const Vec3d corner(at);
    Vec3d from = corner - Vec3d(grow), to = corner + Vec3d(size + grow);
    if (inside || !grid.on_rim(at, size)) return !off_plane(corner, size, grow) && overlaps(from, to, a, b, c);
    for (int i = 0; i < 3; ++i) {  // as far out as the triangle reaches
      if (at[i] == 0) from[i] = std::min(from[i], lower[i]);
      if (at[i] + size == grid.resolution) to[i] = std::max(to[i], upper[i]);
    }
    return overlaps(from, to, a, b, c);
  };
  return mark_cells(
      grid, low, high, bits, [&](Vec3i at, int size) { return meets(at, size, 2.0 * kGrow); },
      [&](int x, int y, int z) {
        return meets({x, y, z}, 1, kGrow);
      });
}

// A sphere's surface meets a box when its centre is nearer than the radius to the box and its farthest corner is not
// inside. Returns what mark_cells() does.
std::uint64_t mark_sphere(const Grid& grid, const Sphere& sphere, Bits& bits) {
  const Vec3d cell = Vec3d(grid.domain.size) / static_cast<double>(grid.resolution);
  const Vec3d center(sphere.center);
  const double r = static_cast<double>(sphere.radius);
  const Vec3i low = grid.cell(grid.cells(sphere.center - Vec3f(sphere.radius)) - Vec3d(kGrow)),
              high = grid.cell(grid.cells(sphere.center + Vec3f(sphere.radius)) + Vec3d(kGrow));
  const auto meets = [&](Vec3i at, int size, double grow) {
    double nearest = 0.0, farthest = 0.0;
    for (int i = 0; i < 3; ++i) {
      double lower = static_cast<double>(grid.domain.origin[i]) + (at[i] - grow) * cell[i] - center[i];
      double upper = lower + (size + 2.0 * grow) * cell[i];
      // On the rim as far out as the sphere reaches.
      if (at[i] == 0) lower = std::min(lower, -r);
      if (at[i] + size == grid.resolution) upper = std::max(upper, r);
      const double gap = std::max({lower, -upper, 0.0}), reach = std::max(std::abs(lower), std::abs(upper));
      nearest += gap * gap;
      farthest += reach * reach;
    }
    return nearest <= r * r && farthest >= r * r;
  };
  return mark_cells(
      grid, low, high, bits, [&](Vec3i at, int size) { return meets(at, size, 2.0 * kGrow); },
      [&](int x, int y, int z) {
        return meets({x, y, z}, 1, kGrow);
      });
}

std::vector<std::vector<Vec3i>> levels_of(const Bits& bits, int levels) {
  std::vector<std::vector<Vec3i>> result(static_cast<std::size_t>(levels));
  std::vector<std::uint64_t> codes = bits.codes();
  for (int l = levels; l >= 1; --l) {
    auto& cells = result[static_cast<std::size_t>(l - 1)];
    cells.reserve(codes.size());
    for (const std::uint64_t code : codes) cells.push_back(morton_cell(code));
    for (std::uint64_t& code : codes) code >>= 3;  // the parent; Morton order is kept
    codes.erase(std::unique(codes.begin(), codes.end()), codes.end());
  }
  return result;
}

Grid make_grid(const Domain& domain, int levels) {
  if (levels < 1 || levels > 9) throw UsageError("octree.levels must lie in 1..9");
  if (!(min_component(domain.size) > 0.0f) || !is_finite(domain.origin) || !is_finite(domain.size))
    throw InputError("the octree's box is empty or not finite");
  return {domain, 1 << (levels + 1)};
}

}  // namespace

Domain scene_domain(const Bounds3f& bounds, bool cube) {
  const float largest = max_component(bounds.upper - bounds.lower);
  const Vec3f pad(cube && largest > 0.0f ? std::min(0.01f, 0.01f * largest) : 0.01f);
  Vec3f lower = bounds.lower - pad, upper = bounds.upper + pad;
  for (int i = 0; i < 3; ++i) {  // a flat scene, so far out that this is less than a float resolves
    if (upper[i] > lower[i]) continue;
    lower[i] -= std::abs(lower[i]) * 1e-5f;
    upper[i] += std::abs(upper[i]) * 1e-5f;
  }
  if (cube) {
    const Vec3f center = (lower + upper) * 0.5f, half(max_component(upper - lower) * 0.5f);
    lower = center - half;
    upper = center + half;
  }
  return {lower, upper - lower};
}

bool overlaps(Vec3d lower, Vec3d upper, Vec3d a, Vec3d b, Vec3d c) {
  const Vec3d center = (lower + upper) * 0.5, half = (upper - lower) * 0.5;
  const std::array<Vec3d, 3> v = {a - center, b - center, c - center};
  const std::array<Vec3d, 3> edges = {v[1] - v[0], v[2] - v[1], v[0] - v[2]};
  const auto separates = [&](Vec3d axis) {
    const double p0 = dot(axis, v[0]), p1 = dot(axis, v[1]), p2 = dot(axis, v[2]);
    const double reach = half.x * std::abs(axis.x) + half.y * std::abs(axis.y) + half.z * std::abs(axis.z);
    return std::min({p0, p1, p2}) > reach || std::max({p0, p1, p2}) < -reach;
  };
  for (int i = 0; i < 3; ++i) {
    Vec3d axis;
    axis[i] = 1.0;
    if (separates(axis)) return false;
    for (const Vec3d& e : edges) {
      if (separates(cross(axis, e))) return false;
    }
  }
  return !separates(cross(edges[0], edges[1]));
}

std::vector<std::vector<Vec3i>> occupied_cells(const Scene& scene, const Domain& domain, int levels,
                                               std::uint64_t most_tests) {
  const Grid grid = make_grid(domain, levels);
  Bits bits(grid.resolution, scene.file);
  const std::vector<std::size_t> first = first_primitives(scene);
  constexpr std::uint64_t tests_of_triangle = 256;
  const std::uint64_t most = most_tests + tests_of_triangle * (scene.triangle_count() + scene.spheres.size());
  std::atomic<std::uint64_t> all_tests = 0;
  parallel_blocks(first.back(), 64, [&](std::size_t begin, std::size_t end) {
    auto s = static_cast<std::size_t>(std::upper_bound(first.begin(), first.end(), begin) - first.begin()) - 1;
    std::uint64_t tests = end - begin;
    for (std::size_t i = begin; i < end; ++s) {
      const std::size_t last = std::min(end, first[s + 1]);
      const Shape& shape = scene.shapes[s];
      const auto geometry = static_cast<std::size_t>(shape.geometry);
      if (shape.kind == Shape::Kind::sphere) {
        for (; i < last; ++i) tests += mark_sphere(grid, scene.spheres[geometry], bits);
        continue;
      }
      const MeshView view = shape_view(scene, s).mesh;
      for (; i < last; ++i) {
        const Vec3i t = scene.meshes[geometry].triangles[i - first[s]];
        tests += mark_triangle(grid, grid.cells(mesh_position(view, t.x)), grid.cells(mesh_position(view, t.y)),
                               grid.cells(mesh_position(view, t.z)), bits);
      }
    }
    if (all_tests.fetch_add(tests) + tests > most) {
      throw InputError(scene.file +
                       ": so many surfaces, each of which meets many cells of the octree, would take minutes to be put "
                       "into them; take fewer octree.levels, or octree.occupancy=sampled");
    }
  });
  return levels_of(bits, levels);
}

std::vector<std::vector<Vec3i>> sampled_cells(const Scene& scene, const Domain& domain, int levels, std::uint64_t seed,
                                              std::uint64_t samples) {
  const Grid grid = make_grid(domain, levels);
  const SurfaceSampler surfaces(scene);
  Bits bits(grid.resolution, scene.file);
  parallel_blocks(samples, 1 << 16, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      Rng rng(seed, RngPurpose::occupancy, i);
      const float pick = rng.uniform();
      const Vec3d p = grid.cells(surfaces.sample_position(pick, rng.uniform2()));
      bits.set(grid.cell(p));
    }
  });
  return levels_of(bits, levels);
}

}  // namespace octrad
