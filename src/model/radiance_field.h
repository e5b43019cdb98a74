// A learned approximation of outgoing radiance (method section 6). Trainers, integrators and the command line see
// fields only through this interface; each field is one .cc and one line in the registry (make_field).
#pragma once

#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "base/surface_point.h"
#include "model/config.h"
#include "model/safetensors.h"

namespace octrad {

// What a field needs to know of the scene: where surfaces are.
struct FieldDomain {
  Bounds3f bounds;                                 // padded box that holds every surface
  std::vector<std::vector<Vec3i>> occupied_cells;  // per level 1..K in Morton order (may be empty for fields without octree)
};

struct FieldStep {
  double loss = 0.0;               // mean over points and channels
  long long non_finite = 0;        // gradients dropped
};

class RadianceField {
 public:
  virtual ~RadianceField() = default;
  virtual std::string name() const = 0;
  // Predicted radiance (emission not added), one RGB per point. Thread-safe; runs in the caller's thread.
  virtual void radiance(std::span<const SurfacePoint> points, std::span<Vec3f> out) const = 0;
  // One optimiser step towards `targets` (linear radiance without own emission). Parallel inside, deterministic.
  virtual FieldStep train(std::span<const SurfacePoint> points, std::span<const Vec3f> targets, double epsilon,
                          double rate_scale) = 0;
  // Exposure: radiance = scale * network output. Chosen once, before the first step.
  virtual void set_target_scale(float scale) = 0;
  // Everything needed to evaluate (and with `optimizer` to continue) in method section 13's names.
  virtual void save(TensorWriter& out, bool optimizer) const = 0;
  virtual void load(const TensorReader& in) = 0;
  virtual std::size_t parameter_count() const = 0;
};

}  // namespace octrad
