// A made-up domain and points on it for tests of fields. Not part of the library.
#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "octrad/base/rng.h"
#include "octrad/base/surface_point.h"
#include "octrad/encoding/octaoctree.h"
#include "octrad/model/nr_field.h"
#include "octrad/model/octaoctree_field.h"
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
    p.disparity = 2.0f * rng.uniform();
  }
  return points;
}

// Glossy points show a pattern of the mirror direction, rough ones a smooth function of the position.
inline Vec3f pattern(const SurfacePoint& p) {
  const Vec3f w = reflect(p.wo, p.n);
  const float v = p.alpha < 0.5f ? 1.0f + 0.8f * std::sin(3.0f * w.x + p.x.y) : p.albedo.x * (1.0f + p.x.z);
  return {v, 0.5f * v, 0.25f * v};
}

// Every number of a field that training changes, by name.
struct Part {
  std::string name;
  std::vector<float> values;
  std::size_t width = 1;  // of a table's entry
};
inline std::vector<Part> parts_of(RadianceField& field) {
  std::vector<Part> parts;
  const auto add = [&](const std::string& name, auto span) { parts.push_back({name, {span.begin(), span.end()}, 1}); };
  const auto table = [&](const std::string& name, std::span<const float> values, SparseAdam& adam) {
    add(name, values);
    add(name + " moments", adam.moments());
    parts.back().width = adam.moments().size() / adam.counts().size() / 2;
    add(name + " counts", adam.counts());
    parts.push_back({name + " steps", {static_cast<float>(adam.global_count())}, 1});
  };
  const auto network = [&](const std::string& name, Mlp& mlp, DenseAdam& adam) {
    add(name, mlp.weights());
    add(name + " m", adam.m());
    add(name + " v", adam.v());
    parts.push_back({name + " steps", {static_cast<float>(adam.count())}, 1});
  };
  if (auto* octree = dynamic_cast<OctaOctreeField*>(&field)) {
    octree->make_optimizers();
    table("octree", octree->octree().features(), *octree->octree_adam());
    table("grid", octree->grid().table(), *octree->grid_adam());
    network("disparity", octree->disparity(), octree->disparity_adam());
    network("decoder", octree->decoder().mlp(), octree->decoder().adam());
  } else {
    auto& nr = dynamic_cast<NrField&>(field);
    nr.make_optimizer();
    table("grid", nr.grid().table(), *nr.grid_adam());
    network("decoder", nr.decoder().mlp(), nr.decoder().adam());
  }
  return parts;
}

// Feature tables with values in +-0.5, as after a long training: new ones are 0 or next to it, which hides gradients.
inline void fill_tables(RadianceField& field, unsigned long long stream = 0) {
  const auto fill = [&](std::span<float> table, unsigned long long number) {
    Rng rng(stream, RngPurpose::test, number);
    for (float& v : table) v = rng.uniform() - 0.5f;
  };
  if (auto* octree = dynamic_cast<OctaOctreeField*>(&field)) {
    fill(octree->octree().features(), 1);
    fill(octree->grid().table(), 2);
  } else {
    fill(dynamic_cast<NrField&>(field).grid().table(), 3);
  }
}

// Trains new fields for one step (train_one_step(field, config)) with one of adam.rate.* at a time above 0: only the
// parts that it is the rate of move.
template <typename TrainOneStep>
void check_rates(Config config, int levels, const TrainOneStep& train_one_step) {
  for (const std::string rate : {"features", "networks", "grids"}) {
    for (const std::string other : {"features", "networks", "grids"})
      set(config, "adam.rate." + other, other == rate ? "1e-3" : "0");
    const auto field = make_field(config, shell(levels));
    fill_tables(*field);
    const std::vector<Part> before = parts_of(*field);
    train_one_step(*field, config);
    const std::vector<Part> after = parts_of(*field);
    for (std::size_t i = 0; i < before.size(); ++i) {
      const std::string& part = before[i].name;
      if (part.find(' ') != std::string::npos) continue;  // the optimiser's state
      const std::string its = part == "octree" ? "features" : part == "grid" ? "grids" : "networks";
      EXPECT_EQ(before[i].values != after[i].values, its == rate) << part << " with adam.rate." << rate << " alone";
    }
  }
}

}  // namespace octrad::testing
