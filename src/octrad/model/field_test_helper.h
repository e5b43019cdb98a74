// A made-up domain and points on it for tests of fields. Not part of the library.
#pragma once

#include <gtest/gtest.h>

#include <stdlib.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "octrad/base/error.h"
#include "octrad/base/hit_cluster.h"
#include "octrad/base/rng.h"
#include "octrad/base/surface_point.h"
#include "octrad/encoding/octaoctree.h"
#include "octrad/model/ncr_field.h"
#include "octrad/model/nr_field.h"
#include "octrad/model/octaoctree_field.h"
#include "octrad/model/radiance_field.h"
#include "octrad/model/safetensors.h"

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
    // Of four clusters the second is often empty; the shares add up to less than 1.
    for (int k = 0; k < kHitClusters; ++k)
      p.lobe[k] = {0.2f * static_cast<float>(k) + 0.3f * rng.uniform(), 0.1f * rng.uniform(),
                   k == 1 && i % 4 < 3 ? 0.0f : 0.3f * rng.uniform()};
    // Some rays of the offset meet nothing, some something rough.
    p.reflected = {i % 5 == 0 ? 0.0f : 1.0f, rng.uniform() < 0.5f ? 1.0f : 0.3f, direction(),
                   Vec3f(rng.uniform(), rng.uniform(), rng.uniform()),
                   Vec3f(rng.uniform(), rng.uniform(), rng.uniform()) * 3.0f};
    if (i % 3 == 0) p.reflected.w = normalize(reflect(p.wo, p.n) + p.n * 0.3f);
  }
  return points;
}

// Glossy points show a pattern of the mirror direction, rough ones a smooth function of the position.
inline Vec3f pattern(const SurfacePoint& p) {
  const Vec3f w = reflect(p.wo, p.n);
  const float v = p.alpha < 0.5f ? 1.0f + 0.8f * std::sin(3.0f * w.x + p.x.y) : p.albedo.x * (1.0f + p.x.z);
  return {v, 0.5f * v, 0.25f * v};
}

// A field as a model file holds it, with the optimiser's state.
class SavedField {
 public:
  explicit SavedField(RadianceField& field) {
    std::string name = (std::filesystem::temp_directory_path() / "octrad_field_XXXXXX").string();
    const int descriptor = ::mkstemp(name.data());
    if (descriptor < 0) throw IoError("no temporary file " + name);
    ::close(descriptor);
    TensorWriter out;
    field.save(out);
    field.save_optimizer(out);
    out.write(name);
    reader_ = std::make_unique<TensorReader>(name);
    std::filesystem::remove(name);
  }
  const TensorReader& reader() const { return *reader_; }

 private:
  std::unique_ptr<TensorReader> reader_;
};

// Every tensor of a field with its optimiser's state, by name. So tests reach what training changes in any field.
struct SavedTensor {
  std::vector<std::int64_t> shape;
  std::vector<double> values;
};
inline std::map<std::string, SavedTensor> tensors_of(RadianceField& field) {
  const SavedField saved(field);
  std::map<std::string, SavedTensor> result;
  for (const std::string& name : saved.reader().names()) {
    const TensorReader::Tensor tensor = saved.reader().get(name);
    SavedTensor& to = result[name];
    to.shape = tensor.shape;
    const auto copy = [&](auto number) {
      std::vector<decltype(number)> from(static_cast<std::size_t>(tensor.count));
      saved.reader().read(tensor, from.data());
      to.values.assign(from.begin(), from.end());
    };
    switch (tensor.type) {
      case DType::f32: copy(float{}); break;
      case DType::u16: copy(std::uint16_t{}); break;
      case DType::i32: copy(std::int32_t{}); break;
      case DType::i64: copy(std::int64_t{}); break;
      default: ADD_FAILURE() << name << " has a type that fields do not save";
    }
  }
  return result;
}

// Feature tables with values in +-0.5, as after a long training: new ones are 0 or next to it, which hides gradients.
inline void fill_tables(RadianceField& field, unsigned long long stream = 0) {
  const auto fill = [&](std::span<float> table, unsigned long long number) {
    Rng rng(stream, RngPurpose::test, number);
    for (float& v : table) v = rng.uniform() - 0.5f;
  };
  if (auto* octree = dynamic_cast<OctaOctreeField*>(&field)) {
    fill(octree->octree().features(), 1);
    if (octree->predictor() != nullptr) fill(octree->predictor()->grid.table(), 2);
  } else if (auto* ncr = dynamic_cast<NcrField*>(&field)) {
    fill(ncr->grid().table(), 4);
    fill(ncr->cone_grid().table(), 5);
  } else {
    fill(dynamic_cast<NrField&>(field).grid().table(), 3);
  }
}

// Trains a field that has learnt a little for one more step (train_one_step(field, config)) with one of adam.rate.* at
// a time above 0: each tensor moves with one of them, hash grids with adam.rate.grids and networks with
// adam.rate.networks.
template <typename TrainOneStep>
void check_rates(Config config, const FieldDomain& domain, const TrainOneStep& train_one_step) {
  const std::vector<std::string> rates{"features", "networks", "grids"};
  const auto start = make_field(config, domain);
  for (int step = 0; step < 3; ++step) train_one_step(*start, config);
  const SavedField saved(*start);
  std::map<std::string, std::vector<std::string>> moved;  // by tensor: with which rates
  for (const std::string& rate : rates) {
    for (const std::string& other : rates) set(config, "adam.rate." + other, other == rate ? "1e-3" : "0");
    const auto field = make_field(config, domain);
    field->load(saved.reader());
    field->load_optimizer(saved.reader());
    const auto before = tensors_of(*field);
    train_one_step(*field, config);
    for (const auto& [name, tensor] : tensors_of(*field)) {
      if (name.starts_with("optimizer.")) continue;
      if (tensor.values != before.at(name).values) moved[name].push_back(rate);
    }
  }
  for (const std::string& name : saved.reader().names()) {
    if (!name.ends_with(".weight") && !name.ends_with(".table") && !name.ends_with(".features")) continue;
    ASSERT_EQ(moved.count(name), 1u) << name << " does not learn";
  }
  for (const auto& [name, with] : moved) {
    const bool grid = name.find("grid") != std::string::npos, network = name.find("mlp") != std::string::npos;
    EXPECT_EQ(with.size(), 1u) << name;
    EXPECT_EQ(with[0] == "grids", grid) << name << " moves with adam.rate." << with[0];
    EXPECT_EQ(with[0] == "networks", network) << name << " moves with adam.rate." << with[0];
  }
}

struct TrainingBatch {
  std::vector<SurfacePoint> points;
  std::vector<Vec3f> targets;
  double epsilon = 0.3;
};

// The shell of field_test_helper.h in a box that is no cube and lies off the origin.
inline FieldDomain box_domain(int levels) {
  FieldDomain domain = shell(levels);
  domain.origin = {-1.0f, 0.5f, 2.0f};
  domain.size = {2.0f, 1.0f, 3.0f};
  return domain;
}

// Points of it: of every twenty, one lies anywhere in the box and one beside it.
inline std::vector<SurfacePoint> box_points(std::size_t n, unsigned long long stream) {
  const FieldDomain box = box_domain(0);
  std::vector<SurfacePoint> points = random_points(n, stream);
  for (std::size_t i = 0; i < n; ++i) {
    Rng rng(stream, RngPurpose::test, 1'000'000 + i);
    SurfacePoint& p = points[i];
    if (i % 10 == 0) p.x = {rng.uniform(), rng.uniform(), rng.uniform()};
    if (i % 20 == 0) p.x = p.x * 5.0f - Vec3f(2.0f);
    p.x = box.origin + p.x * box.size;
    p.alpha = i % 3 == 0 ? 0.05f : (i % 3 == 1 ? 0.5f : 1.0f);
    p.disparity = 2.0f * rng.uniform();
  }
  return points;
}

}  // namespace octrad::testing
