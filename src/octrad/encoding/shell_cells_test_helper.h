// A synthetic scene for tests and benchmarks of encodings: the walls of a box and spheres in it, as occupied cells and
// random points on the surfaces. Not part of the library.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "octrad/base/random_inputs.h"
#include "octrad/base/vec.h"
#include "octrad/encoding/octaoctree.h"

namespace octrad::testing {

// In the unit cube: a box with a margin of 0.04 and `spheres` spheres inside it.
class ShellScene {
 public:
  explicit ShellScene(int spheres, std::uint64_t seed = 1) {
    Rng rng(seed, RngPurpose::test, 0);
    for (int i = 0; i < spheres; ++i) {
      const double radius = 0.05 + 0.1 * rng.uniform();
      const auto coordinate = [&] { return kMargin + radius + (1.0 - 2.0 * (kMargin + radius)) * rng.uniform(); };
      const double x = coordinate(), y = coordinate(), z = coordinate();
      centers_.push_back({x, y, z});
      radii_.push_back(radius);
    }
    areas_.push_back(6.0 * kSide * kSide);
    for (double r : radii_) areas_.push_back(areas_.back() + 4.0 * 3.14159265358979 * r * r);
  }

  // Distance to the nearest surface; at most 1-Lipschitz.
  double distance(Vec3d p) const {
    const Vec3d q{std::abs(p.x - 0.5) - 0.5 * kSide, std::abs(p.y - 0.5) - 0.5 * kSide,
                  std::abs(p.z - 0.5) - 0.5 * kSide};
    double d = std::abs(length(max(q, Vec3d(0.0))) + std::min(max_component(q), 0.0));
    for (std::size_t i = 0; i < radii_.size(); ++i) d = std::min(d, std::abs(length(p - centers_[i]) - radii_[i]));
    return d;
  }

  // Occupied cells of levels 1..K, each in Morton order: centre within `reach` half diagonals of a surface.
  std::vector<std::vector<Vec3i>> cells(int levels, double reach = 1.0) const {
    std::vector<std::vector<Vec3i>> result;
    std::vector<Vec3i> candidates;
    for (int k = 0; k < 64; ++k) {
      Vec3i c;
      for (int b = 0; b < 2; ++b)
        c += Vec3i{(k >> (3 * b)) & 1, (k >> (3 * b + 1)) & 1, (k >> (3 * b + 2)) & 1} * (1 << b);
      candidates.push_back(c);
    }
    for (int l = 1; l <= levels; ++l) {
      const double edge = 1.0 / spatial_resolution(l);
      std::vector<Vec3i> occupied, next;
      for (const Vec3i& c : candidates) {
        const Vec3d center = (Vec3d(c) + Vec3d(0.5)) * edge;
        if (distance(center) > reach * 0.5 * std::sqrt(3.0) * edge) continue;
        occupied.push_back(c);
        for (int k = 0; k < 8; ++k) next.push_back(c * 2 + Vec3i{k & 1, k >> 1 & 1, k >> 2 & 1});
      }
      result.push_back(std::move(occupied));
      candidates = std::move(next);
    }
    return result;
  }

  // Uniform by area.
  Vec3f point(Rng& rng) const {
    const double a = rng.uniform() * areas_.back();
    const std::size_t i = static_cast<std::size_t>(std::lower_bound(areas_.begin(), areas_.end(), a) - areas_.begin());
    if (i == 0) {
      const std::uint32_t side = rng.below(6);
      Vec3d p;
      for (int k = 0; k < 3; ++k) p[k] = kMargin + kSide * rng.uniform();
      p[static_cast<int>(side >> 1)] = (side & 1) != 0 ? 1.0 - kMargin : kMargin;
      return Vec3f(p);
    }
    return Vec3f(centers_[std::min(i, radii_.size()) - 1] +
                 Vec3d(direction(rng)) * radii_[std::min(i, radii_.size()) - 1]);
  }

  static Vec3f direction(Rng& rng) {
    const float z = 1.0f - 2.0f * rng.uniform(), phi = 2.0f * kPi * rng.uniform(),
                r = std::sqrt(std::max(0.0f, 1.0f - z * z));
    return {r * std::cos(phi), r * std::sin(phi), z};
  }

 private:
  static constexpr double kMargin = 0.04, kSide = 1.0 - 2.0 * kMargin;
  std::vector<Vec3d> centers_;
  std::vector<double> radii_, areas_;
};

}  // namespace octrad::testing
