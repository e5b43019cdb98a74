#include "octrad/geometry/voxelize.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>

#include "octrad/base/error.h"
#include "octrad/base/rng.h"
#include "octrad/base/threads.h"
#include "octrad/geometry/surface_sampling.h"

namespace octrad {
namespace {

constexpr double kGrow = 1e-4;  // of a cell: rounding of positions to float must not open holes

// One bit a cell of the finest level, set from several threads; the result does not depend on their order.
class Bits {
 public:
  explicit Bits(int resolution) : n_(static_cast<std::uint64_t>(resolution)), words_((n_ * n_ * n_ + 63) / 64) {}
  void set(Vec3i c) {
    const std::uint64_t code = morton_code(c);
    std::atomic_ref<std::uint64_t> word(words_[code >> 6]);
    const std::uint64_t bit = std::uint64_t{1} << (code & 63);
    if (!(word.load(std::memory_order_relaxed) & bit)) word.fetch_or(bit, std::memory_order_relaxed);
  }
  // Set cells in Morton order.
  std::vector<std::uint64_t> codes() const {
    std::vector<std::uint64_t> result;
    for (std::size_t w = 0; w < words_.size(); ++w) {
      for (std::uint64_t rest = words_[w]; rest; rest &= rest - 1)
        result.push_back((w << 6) + static_cast<std::uint64_t>(__builtin_ctzll(rest)));
    }
    return result;
  }

 private:
  std::uint64_t n_;
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
  // A cell on the rim also holds what lies outside the domain beside it: positions there are moved to it.
  bool on_rim(Vec3i c) const { return min_component(c) == 0 || max_component(c) == resolution - 1; }
  // Corners of the cell, grown; where it is on the rim as far out as `least` and `most`.
  Vec3d lower(Vec3i c, Vec3d least) const {
    Vec3d r;
    for (int a = 0; a < 3; ++a) r[a] = c[a] == 0 ? std::min(-kGrow, least[a]) : c[a] - kGrow;
    return r;
  }
  Vec3d upper(Vec3i c, Vec3d most) const {
    Vec3d r;
    for (int a = 0; a < 3; ++a)
      r[a] = c[a] == resolution - 1 ? std::max(resolution + kGrow, most[a]) : c[a] + 1.0 + kGrow;
    return r;
  }
};

void mark_triangle(const Grid& grid, Vec3d a, Vec3d b, Vec3d c, Bits& bits) {
  const Vec3d low = min(min(a, b), c) - Vec3d(kGrow), high = max(max(a, b), c) + Vec3d(kGrow);
  const int x0 = grid.clamp(low.x), y0 = grid.clamp(low.y), z0 = grid.clamp(low.z);
  const int x1 = grid.clamp(high.x), y1 = grid.clamp(high.y), z1 = grid.clamp(high.z);
  const bool single = x0 == x1 && y0 == y1 && z0 == z1;
  const bool inside = min_component(low) >= 0.0 && max_component(high) <= grid.resolution;
  const Vec3d n = cross(b - a, c - a);
  const double n_reach = (std::abs(n.x) + std::abs(n.y) + std::abs(n.z)) * (0.5 + kGrow), n_offset = dot(n, a);
  for (int z = z0; z <= z1; ++z) {
    for (int y = y0; y <= y1; ++y) {
      for (int x = x0; x <= x1; ++x) {
        const Vec3d corner(x, y, z);
        if (!single) {
          if (!inside && grid.on_rim({x, y, z})) {
            if (!overlaps(grid.lower({x, y, z}, low), grid.upper({x, y, z}, high), a, b, c)) continue;
          } else {
            if (std::abs(dot(n, corner + Vec3d(0.5)) - n_offset) > n_reach)
              continue;  // most cells of a large triangle's box fail here
            if (!overlaps(corner - Vec3d(kGrow), corner + Vec3d(1.0 + kGrow), a, b, c)) continue;
          }
        }
        bits.set({x, y, z});
      }
    }
  }
}

// A sphere's surface meets a box when its centre is nearer than the radius to the box and its farthest corner is not
// inside.
void mark_sphere(const Grid& grid, const Sphere& sphere, Bits& bits) {
  const Vec3d cell = Vec3d(grid.domain.size) / static_cast<double>(grid.resolution);
  const Vec3d center(sphere.center);
  const double r = static_cast<double>(sphere.radius);
  const Vec3d low = grid.cells(sphere.center - Vec3f(sphere.radius)) - Vec3d(kGrow),
              high = grid.cells(sphere.center + Vec3f(sphere.radius)) + Vec3d(kGrow);
  for (int z = grid.clamp(low.z); z <= grid.clamp(high.z); ++z) {
    for (int y = grid.clamp(low.y); y <= grid.clamp(high.y); ++y) {
      for (int x = grid.clamp(low.x); x <= grid.clamp(high.x); ++x) {
        double nearest = 0.0, farthest = 0.0;
        const Vec3d first = grid.lower({x, y, z}, low), last = grid.upper({x, y, z}, high);
        for (int i = 0; i < 3; ++i) {
          const double origin = static_cast<double>(grid.domain.origin[i]) - center[i];
          const double lower = origin + first[i] * cell[i], upper = origin + last[i] * cell[i];
          const double gap = std::max({lower, -upper, 0.0}), reach = std::max(std::abs(lower), std::abs(upper));
          nearest += gap * gap;
          farthest += reach * reach;
        }
        if (nearest <= r * r && farthest >= r * r) bits.set({x, y, z});
      }
    }
  }
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
  const Vec3f pad(0.01f);
  Vec3f lower = bounds.lower - pad, upper = bounds.upper + pad;
  if (cube) {
    const Vec3f center = (lower + upper) * 0.5f, half(max_component(upper - lower) * 0.5f);
    lower = center - half;
    upper = center + half;
  }
  return {lower, upper - lower};
}

std::uint64_t morton_code(Vec3i cell) {
  const auto spread = [](int v) {
    std::uint64_t x = static_cast<std::uint64_t>(v) & 0x1fffff;
    x = (x | x << 32) & 0x1f00000000ffffull;
    x = (x | x << 16) & 0x1f0000ff0000ffull;
    x = (x | x << 8) & 0x100f00f00f00f00full;
    x = (x | x << 4) & 0x10c30c30c30c30c3ull;
    return (x | x << 2) & 0x1249249249249249ull;
  };
  return spread(cell.x) | spread(cell.y) << 1 | spread(cell.z) << 2;
}

Vec3i morton_cell(std::uint64_t code) {
  const auto gather = [](std::uint64_t x) {
    x &= 0x1249249249249249ull;
    x = (x | x >> 2) & 0x10c30c30c30c30c3ull;
    x = (x | x >> 4) & 0x100f00f00f00f00full;
    x = (x | x >> 8) & 0x1f0000ff0000ffull;
    x = (x | x >> 16) & 0x1f00000000ffffull;
    return static_cast<int>((x | x >> 32) & 0x1fffff);
  };
  return {gather(code), gather(code >> 1), gather(code >> 2)};
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

std::vector<std::vector<Vec3i>> occupied_cells(const Scene& scene, const Domain& domain, int levels) {
  const Grid grid = make_grid(domain, levels);
  Bits bits(grid.resolution);
  for (const Shape& shape : scene.shapes) {
    if (shape.kind == Shape::Kind::sphere) {
      mark_sphere(grid, scene.spheres[static_cast<std::size_t>(shape.geometry)], bits);
      continue;
    }
    const TriangleMesh& mesh = scene.meshes[static_cast<std::size_t>(shape.geometry)];
    parallel_blocks(mesh.triangles.size(), 64, [&](std::size_t begin, std::size_t end) {
      for (std::size_t t = begin; t < end; ++t) {
        const Vec3i tri = mesh.triangles[t];
        mark_triangle(grid, grid.cells(mesh.positions[static_cast<std::size_t>(tri.x)]),
                      grid.cells(mesh.positions[static_cast<std::size_t>(tri.y)]),
                      grid.cells(mesh.positions[static_cast<std::size_t>(tri.z)]), bits);
      }
    });
  }
  return levels_of(bits, levels);
}

std::vector<std::vector<Vec3i>> sampled_cells(const Scene& scene, const Domain& domain, int levels, std::uint64_t seed,
                                              std::uint64_t samples) {
  const Grid grid = make_grid(domain, levels);
  const SurfaceSampler surfaces(scene);
  Bits bits(grid.resolution);
  parallel_blocks(samples, 1 << 16, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      Rng rng(seed, RngPurpose::occupancy, i);
      const float pick = rng.uniform();
      const Vec3d p = grid.cells(surfaces.sample_position(pick, rng.uniform2()));
      bits.set({grid.clamp(p.x), grid.clamp(p.y), grid.clamp(p.z)});
    }
  });
  return levels_of(bits, levels);
}

}  // namespace octrad
