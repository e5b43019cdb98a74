// A made-up domain and points on it for tests of fields. Not part of the library.
#pragma once

#include <cmath>
#include <vector>

#include "octrad/base/rng.h"
#include "octrad/base/surface_point.h"
#include "octrad/encoding/octaoctree.h"
#include "octrad/model/radiance_field.h"

namespace octrad::testing {

// Every cell of a level that a sphere shell of radius 0.35 around the middle of the unit cube passes through.
inline FieldDomain shell(int levels) {
  FieldDomain domain{{0, 0, 0}, {1, 1, 1}, {}};
  for (int l = 1; l <= levels; ++l) {
    const int r = spatial_resolution(l);
    std::vector<Vec3i> cells;
    for (std::uint64_t code = 0;
         code < static_cast<std::uint64_t>(r) * static_cast<std::uint64_t>(r) * static_cast<std::uint64_t>(r); ++code) {
      Vec3i c;
      for (int b = 0; b <= l; ++b) {
        for (int a = 0; a < 3; ++a) c[a] |= static_cast<int>(code >> (3 * b + a) & 1) << b;
      }
      const float distance = length((Vec3f(c) + Vec3f(0.5f)) / static_cast<float>(r) - Vec3f(0.5f));
      if (std::abs(distance - 0.35f) < 0.9f / static_cast<float>(r)) cells.push_back(c);
    }
    domain.occupied_cells.push_back(cells);
  }
  return domain;
}

inline std::vector<SurfacePoint> random_points(std::size_t n, unsigned long long stream) {
  std::vector<SurfacePoint> points(n);
  for (std::size_t i = 0; i < n; ++i) {
    Rng rng(stream, RngPurpose::test, i);
    const auto direction = [&] {
      const float z = 1.0f - 2.0f * rng.uniform(), phi = 2.0f * kPi * rng.uniform(), r = std::sqrt(1.0f - z * z);
      return Vec3f(r * std::cos(phi), r * std::sin(phi), z);
    };
    SurfacePoint& p = points[i];
    p.n = direction();
    p.x = Vec3f(0.5f) + p.n * 0.35f;
    p.wo = direction();
    if (dot(p.wo, p.n) < 0.0f) p.wo = -p.wo;
    p.albedo = Vec3f(rng.uniform(), rng.uniform(), rng.uniform()) * 0.8f + Vec3f(0.1f);
    p.alpha = i % 2 ? 0.05f : 1.0f;
  }
  return points;
}

// Glossy points show a pattern of the mirror direction, rough ones a smooth function of the position.
inline Vec3f pattern(const SurfacePoint& p) {
  const Vec3f w = reflect(p.wo, p.n);
  const float v = p.alpha < 0.5f ? 1.0f + 0.8f * std::sin(3.0f * w.x + p.x.y) : p.albedo.x * (1.0f + p.x.z);
  return {v, 0.5f * v, 0.25f * v};
}

}  // namespace octrad::testing
