// The paper's field: disparity predictor, OctaOctree encoding, decoder (method sections 4-7).
#pragma once

#include <atomic>
#include <memory>

#include "octrad/base/lookup_rule.h"
#include "octrad/encoding/hash_grid.h"
#include "octrad/encoding/octaoctree.h"
#include "octrad/model/field_base.h"
#include "octrad/model/field_registry.h"

namespace octrad {

// Parts of such a field.
HashGridOptions disparity_grid_options(const Config& config);
MlpShape disparity_shape(const Config& config);
MlpShape decoder_shape(const Config& config);

// What gives each query its disparity, with lookup.offset = predicted.
struct DisparityPredictor {
  explicit DisparityPredictor(const Config& config);
  HashGrid grid;
  Mlp network;
};

class OctaOctreeField : public FieldBase {
 public:
  OctaOctreeField(const Config& config, const FieldDomain& domain);

  std::string name() const override { return "octaoctree"; }
  void radiance(std::span<const SurfacePoint> points, std::span<Vec3f> out) const override;
  int feature_count() const override { return octree_.feature_count(); }
  bool uses_disparity() const override { return true; }
  int levels() const override { return octree_.options().levels; }
  std::vector<long long> cells_per_level() const override;
  long long take_empty_lookups() const override { return empty_lookups_.exchange(0); }
  void inspect(std::span<const SurfacePoint> points, std::span<float> features,
               std::span<float> disparity) const override;

  // For the counterpart on a device.
  LookupOffset offset() const { return offset_; }
  const LookupRule& lookup_rule() const { return rule_; }
  float disparity_unit() const { return disparity_unit_; }
  OctaOctree& octree() { return octree_; }
  DisparityPredictor* predictor() { return predictor_.get(); }  // null with other offsets

 protected:
  void differentiate(std::span<const SurfacePoint> points, std::span<const Vec3f> targets, const BatchPart& part,
                     Gradients& gradients) override;

 private:
  struct Encoded;                                       // intermediate values of a chunk of queries
  static constexpr std::size_t kDisparity = 1;          // among the networks
  static constexpr std::size_t kOctree = 0, kGrid = 1;  // among the tables

  void encode(std::span<const SurfacePoint> points, Encoded& e, bool record) const;
  void predict_disparity(Encoded& e, bool record) const;
  void look_up_reflected(std::span<const SurfacePoint> points, Encoded& e, bool record) const;
  void save_octree(TensorWriter& out);
  void load_octree(const TensorReader& in);

  LookupRule rule_;
  LookupOffset offset_;
  float disparity_unit_;  // disparity = SquarePlus(output) * unit, in 1/world units
  OctaOctree octree_;
  std::unique_ptr<DisparityPredictor> predictor_;
  bool reflects_;  // looks_up_reflected()
  mutable std::atomic<long long> empty_lookups_ = 0;
};

extern const FieldEntry kOctaOctreeField;
std::unique_ptr<DeviceField> make_device_octaoctree(Stream& stream, RadianceField& field, const Config& config,
                                                    const DeviceFieldOptions& options);
std::vector<MemoryPart> device_octaoctree_memory(const Config& config, const std::vector<long long>& cells_per_level,
                                                 const DeviceFieldOptions& options);

}  // namespace octrad
