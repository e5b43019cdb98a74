// Neural Cone Radiosity (Ren et al. 2025, arXiv 2509.07522; method section 9): Neural Radiosity for the diffuse part;
// on glossy surfaces also cones to where rays of the BSDF end, looked up in a grid at the size of their footprints.
#pragma once

#include <memory>

#include "octrad/encoding/hash_grid.h"
#include "octrad/model/decoder_head.h"
#include "octrad/model/field_registry.h"
#include "octrad/model/field_storage.h"
#include "octrad/model/ncr_math.h"

namespace octrad {

// The shapes of its parts.
HashGridOptions ncr_grid_options(const Config& config);
HashGridOptions ncr_cone_grid_options(const Config& config);
MlpShape ncr_cone_shape(const Config& config);
MlpShape ncr_merge_shape(const Config& config);

class NcrField : public RadianceField {
 public:
  NcrField(const Config& config, const FieldDomain& domain);

  std::string name() const override { return "ncr"; }
  void radiance(std::span<const SurfacePoint> points, std::span<Vec3f> out) const override;
  FieldStep train(std::span<const SurfacePoint> points, std::span<const Vec3f> targets, double epsilon,
                  RateScale scale) override;
  void set_target_scale(float scale) override { decoder_.set_target_scale(scale); }
  float target_scale() const override { return decoder_.target_scale(); }
  Vec3f normalized(Vec3f x) const override { return (x - origin_) / size_; }
  // Features and levels are those of the diffuse branch's grid.
  int feature_count() const override { return grid_.feature_count(); }
  int levels() const override { return grid_.options().levels; }
  void inspect(std::span<const SurfacePoint> points, std::span<float> features,
               std::span<float> disparity) const override;
  std::vector<WeightArray> weights() override;
  void weights_changed() override;
  void save(TensorWriter& out) override;
  void save_optimizer(TensorWriter& out) override;
  void load(const TensorReader& in) override;
  void load_optimizer(const TensorReader& in) override;

  // What the field is made of, for its counterpart on a device.
  Vec3f origin() const { return origin_; }
  Vec3f size() const { return size_; }
  HashGrid& grid() { return grid_; }
  DecoderHead& decoder() { return decoder_; }
  HashGrid& cone_grid() { return cone_grid_; }
  Mlp& cone_mlp() { return cone_mlp_; }
  Mlp& merge_mlp() { return merge_mlp_; }
  DenseAdam& cone_adam() { return cone_adam_; }
  DenseAdam& merge_adam() { return merge_adam_; }
  SparseAdam* grid_adam() { return grid_adam_.get(); }  // null until make_optimizers()
  SparseAdam* cone_grid_adam() { return cone_grid_adam_.get(); }
  void make_optimizers();
  const LobeTable& lobe() const { return lobe_; }
  float extent() const { return extent_; }  // largest side: the unit of cones

 private:
  struct Encoded;    // intermediate values of a chunk of queries
  struct Gradients;  // gradients of a group of queries in one step

  void encode(std::span<const SurfacePoint> points, Encoded& e, bool record) const;
  void evaluate(std::span<const SurfacePoint> points, Encoded& e, bool record) const;
  void backward(std::size_t points, std::size_t first, Encoded& e, Gradients& gradients);

  Config config_;
  Vec3f origin_, size_;
  float extent_;
  LobeTable lobe_;
  HashGrid grid_;
  DecoderHead decoder_;  // of the diffuse branch; its loss and activation are those of glossy points, too
  HashGrid cone_grid_;
  Mlp cone_mlp_, merge_mlp_;
  DenseAdam cone_adam_, merge_adam_;
  std::unique_ptr<SparseAdam> grid_adam_, cone_grid_adam_;  // made when training starts
  std::vector<float> upstream_, cone_upstream_;             // [point][level][feature], [point][cluster][feature]
};

extern const FieldEntry kNcrField;
std::unique_ptr<DeviceField> make_device_ncr(Stream& stream, RadianceField& field, const Config& config,
                                             const DeviceFieldOptions& options);
std::vector<MemoryPart> device_ncr_memory(const Config& config, const std::vector<long long>& cells_per_level,
                                          const DeviceFieldOptions& options);

}  // namespace octrad
