// The paper's field: disparity predictor, OctaOctree encoding, decoder (method sections 4-7).
#pragma once

#include <atomic>
#include <memory>

#include "octrad/base/lookup_rule.h"
#include "octrad/encoding/hash_grid.h"
#include "octrad/encoding/octaoctree.h"
#include "octrad/model/decoder_head.h"
#include "octrad/model/field_registry.h"
#include "octrad/model/field_storage.h"
#include "octrad/network/adam.h"

namespace octrad {

// Parts of such a field.
HashGridOptions disparity_grid_options(const Config& config);
MlpShape disparity_shape(const Config& config);
MlpShape decoder_shape(const Config& config);

class OctaOctreeField : public RadianceField {
 public:
  OctaOctreeField(const Config& config, const FieldDomain& domain);

  std::string name() const override { return "octaoctree"; }
  void radiance(std::span<const SurfacePoint> points, std::span<Vec3f> out) const override;
  FieldStep train(std::span<const SurfacePoint> points, std::span<const Vec3f> targets, double epsilon,
                  RateScale scale) override;
  void set_target_scale(float scale) override { decoder_.set_target_scale(scale); }
  float target_scale() const override { return decoder_.target_scale(); }
  Vec3f normalized(Vec3f x) const override { return (x - origin_) / size_; }
  int feature_count() const override { return octree_.feature_count(); }
  bool uses_disparity() const override { return true; }
  int levels() const override { return octree_.options().levels; }
  std::vector<long long> cells_per_level() const override;
  long long take_empty_lookups() const override { return empty_lookups_.exchange(0); }
  void inspect(std::span<const SurfacePoint> points, std::span<float> features,
               std::span<float> disparity) const override;
  std::vector<WeightArray> weights() override;
  void weights_changed() override;
  void save(TensorWriter& out) override;
  void save_optimizer(TensorWriter& out) override;
  void load(const TensorReader& in) override;
  void load_optimizer(const TensorReader& in) override;

  // What the field is made of, for its counterpart on a device.
  LookupOffset offset() const { return offset_; }
  const LookupRule& lookup_rule() const { return rule_; }
  float disparity_unit() const { return disparity_unit_; }
  OctaOctree& octree() { return octree_; }
  HashGrid& grid() { return grid_; }
  Mlp& disparity() { return disparity_; }
  DenseAdam& disparity_adam() { return disparity_adam_; }
  DecoderHead& decoder() { return decoder_; }
  SparseAdam* octree_adam() { return octree_adam_.get(); }  // null until make_optimizers()
  SparseAdam* grid_adam() { return grid_adam_.get(); }
  void make_optimizers();

 private:
  struct Encoded;    // intermediate values of a chunk of queries
  struct Gradients;  // gradients of a group of queries in one step

  void encode(std::span<const SurfacePoint> points, Encoded& e, bool record) const;
  void predict_disparity(Encoded& e, bool record) const;
  void look_up_reflected(std::span<const SurfacePoint> points, Encoded& e, bool record) const;
  double backward(std::span<const SurfacePoint> points, std::span<const Vec3f> targets, std::size_t first,
                  std::size_t batch, double epsilon, Encoded& e, Gradients& gradients);

  Config config_;
  Vec3f origin_, size_;
  LookupRule rule_;
  LookupOffset offset_;
  float disparity_unit_;  // disparity = SquarePlus(output) * unit, in 1/world units
  OctaOctree octree_;
  HashGrid grid_;
  Mlp disparity_;
  bool reflects_;  // looks_up_reflected()
  DecoderHead decoder_;
  DenseAdam disparity_adam_;
  std::unique_ptr<SparseAdam> octree_adam_, grid_adam_;  // made when training starts: they are larger than the field
  mutable std::atomic<long long> empty_lookups_ = 0;
  std::vector<float> octree_upstream_, grid_upstream_;  // [point][level][feature]
};

extern const FieldEntry kOctaOctreeField;
std::unique_ptr<DeviceField> make_device_octaoctree(Stream& stream, RadianceField& field, const Config& config,
                                                    const DeviceFieldOptions& options);
std::vector<MemoryPart> device_octaoctree_memory(const Config& config, const std::vector<long long>& cells_per_level,
                                                 const DeviceFieldOptions& options);

}  // namespace octrad
