// A learned approximation of outgoing radiance (method section 6). Trainers, integrators and the command line see
// fields only through this interface and what field_registry.h lists of each.
#pragma once

#include <memory>
#include <span>
#include <string>
#include <vector>

#include "octrad/base/bytes.h"
#include "octrad/base/query_rays.h"
#include "octrad/base/surface_point.h"
#include "octrad/model/config.h"
#include "octrad/model/safetensors.h"

namespace octrad {

// What a field needs of the scene: its box and the cells that hold surfaces.
struct FieldDomain {
  Vec3f origin, size;                              // box of normalised positions, world units
  std::vector<std::vector<Vec3i>> occupied_cells;  // per level in Morton order, as many levels as the field needs

  std::vector<long long> cells_per_level() const {
    std::vector<long long> counts;
    for (const auto& cells : occupied_cells) counts.push_back(static_cast<long long>(cells.size()));
    return counts;
  }
};

// What multiplies the learning rates in a step: of tables, and of networks.
struct RateScale {
  double tables = 1.0, networks = 1.0;
  RateScale(double all) : tables(all), networks(all) {}
  RateScale(double of_tables, double of_networks) : tables(of_tables), networks(of_networks) {}
};

struct FieldStep {
  double loss = 0.0;         // mean over points and channels
  long long non_finite = 0;  // gradients dropped
  long long touched = 0;     // table entries updated
};

// An array of what training changes; named in docs/formats.md.
struct WeightArray {
  std::string name;
  std::span<float> values;
};

class RadianceField {
 public:
  virtual ~RadianceField() = default;
  virtual std::string name() const = 0;

  // Predicted radiance, one linear RGB per point. Thread-safe; runs in the caller's thread.
  virtual void radiance(std::span<const SurfacePoint> points, std::span<Vec3f> out) const = 0;

  // One optimiser step towards `targets` (linear radiance). `scale` multiplies the learning rates.
  // Parallel inside; the same bits at any thread count.
  virtual FieldStep train(std::span<const SurfacePoint> points, std::span<const Vec3f> targets, double epsilon,
                          RateScale scale) = 0;

  // Exposure: radiance = scale * network output. Chosen once, before the first step.
  virtual void set_target_scale(float scale) = 0;
  virtual float target_scale() const = 0;

  // For views and `octrad query`. Position in the unit cube of the encoding.
  virtual Vec3f normalized(Vec3f x) const = 0;
  virtual int feature_count() const = 0;
  virtual int levels() const = 0;
  virtual bool uses_disparity() const { return false; }  // look-ups take a disparity; otherwise inspect() gives 0
  // Occupied cells of each level, for estimate_memory() (none for fields without an octree).
  virtual std::vector<long long> cells_per_level() const { return {}; }
  // Look-ups of a level since the last call that found no occupied cell, so that its features were 0: of radiance(),
  // train() and inspect(). 0 for fields without an octree. Thread-safe.
  virtual long long take_empty_lookups() const { return 0; }
  // Encoded features [n][feature_count()] and predicted disparity [n] (1/world units; 0 for fields that predict none).
  // Either output may be empty.
  virtual void inspect(std::span<const SurfacePoint> points, std::span<float> features,
                       std::span<float> disparity) const = 0;

  // All weights, the same arrays in the same order for every field of a configuration and domain. Call
  // weights_changed() after writing to them, before anything else is asked of the field.
  virtual std::vector<WeightArray> weights() = 0;
  virtual void weights_changed() = 0;

  // Add tensors under the names of docs/formats.md: the weights with what they belong to, and the optimiser's state.
  // The memory they view belongs to the field.
  virtual void save(TensorWriter& out) = 0;
  virtual void save_optimizer(TensorWriter& out) = 0;
  // Throw InputError where something is missing, has another shape, or is not finite.
  virtual void load(const TensorReader& in) = 0;
  virtual void load_optimizer(const TensorReader& in) = 0;
};

// Moves every weight of a field by `share` of the way to that of `to`, which has the same configuration and domain;
// from a share of 1 on it is a copy, bit for bit. Parallel inside.
void approach(RadianceField& field, RadianceField& to, float share);

// The field that config.field names. Throws UsageError with the list of known fields.
std::unique_ptr<RadianceField> make_field(const Config& config, const FieldDomain& domain);
std::vector<std::string> field_names();

// What it needs traced from the points that it is given: radiance() and inspect(), or with `training` train().
QueryRays query_rays(const Config& config, bool training = false);
// The same for first hits of pictures, whose many samples may differ in where they look (render.offset_spread).
QueryRays picture_rays(const Config& config);

// Bytes that training (or only evaluating) such a field allocates, before anything is allocated.
std::vector<MemoryPart> estimate_memory(const Config& config, const std::vector<long long>& cells_per_level,
                                        bool training);

}  // namespace octrad
