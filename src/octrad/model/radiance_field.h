// A learned approximation of outgoing radiance (method section 6). Trainers, integrators and the command line see
// fields only through this interface and what field_registry.h lists of each.
#pragma once

#include <memory>
#include <span>
#include <string>
#include <vector>

#include "octrad/base/bytes.h"
#include "octrad/base/surface_point.h"
#include "octrad/model/config.h"
#include "octrad/model/safetensors.h"

namespace octrad {

// What a field needs of the scene: its box and the cells that hold surfaces.
struct FieldDomain {
  Vec3f origin, size;                              // box of normalised positions, world units
  std::vector<std::vector<Vec3i>> occupied_cells;  // per level in Morton order, as many levels as the field needs
};

struct FieldStep {
  double loss = 0.0;         // mean over points and channels
  long long non_finite = 0;  // gradients dropped
  long long touched = 0;     // table entries updated
};

class RadianceField {
 public:
  virtual ~RadianceField() = default;
  virtual std::string name() const = 0;

  // Predicted radiance, one linear RGB per point. Thread-safe; runs in the caller's thread.
  virtual void radiance(std::span<const SurfacePoint> points, std::span<Vec3f> out) const = 0;

  // One optimiser step towards `targets` (linear radiance). `rate_scale` multiplies every learning rate.
  // Parallel inside; the same bits at any thread count.
  virtual FieldStep train(std::span<const SurfacePoint> points, std::span<const Vec3f> targets, double epsilon,
                          double rate_scale) = 0;

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

  // Adds tensors under the names of docs/formats.md. The memory they view belongs to the field.
  virtual void save(TensorWriter& out, bool optimizer) = 0;
  // Reads weights and, with `optimizer`, the optimiser's state. Throws InputError where something of it is missing, has
  // another shape, or is not finite.
  virtual void load(const TensorReader& in, bool optimizer) = 0;
  virtual std::size_t parameter_count() const = 0;
};

// The field that config.field names. Throws UsageError with the list of known fields.
std::unique_ptr<RadianceField> make_field(const Config& config, const FieldDomain& domain);
std::vector<std::string> field_names();

// What it needs traced from the points that it is given: radiance() and inspect(), or with `training` train().
QueryRays query_rays(const Config& config, bool training = false);

// Bytes that training (or only evaluating) such a field allocates, before anything is allocated.
std::vector<MemoryPart> estimate_memory(const Config& config, const std::vector<long long>& cells_per_level,
                                        bool training);

}  // namespace octrad
