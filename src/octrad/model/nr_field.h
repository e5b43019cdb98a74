// Neural Radiosity (Hadadan et al. 2021) as the paper's authors ran it (method section 9): a hash grid over position
// and a decoder. The baseline for the OctaOctree.
#pragma once

#include <memory>

#include "octrad/encoding/hash_grid.h"
#include "octrad/model/decoder_head.h"
#include "octrad/model/field_registry.h"
#include "octrad/model/field_storage.h"

namespace octrad {

HashGridOptions nr_grid_options(const Config& config);

class NrField : public RadianceField {
 public:
  NrField(const Config& config, const FieldDomain& domain);

  std::string name() const override { return "nr"; }
  void radiance(std::span<const SurfacePoint> points, std::span<Vec3f> out) const override;
  FieldStep train(std::span<const SurfacePoint> points, std::span<const Vec3f> targets, double epsilon,
                  RateScale scale) override;
  void set_target_scale(float scale) override { decoder_.set_target_scale(scale); }
  float target_scale() const override { return decoder_.target_scale(); }
  Vec3f normalized(Vec3f x) const override { return (x - origin_) / size_; }
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
  SparseAdam* grid_adam() { return grid_adam_.get(); }  // null until make_optimizer()
  void make_optimizer();

 private:
  struct Encoded;
  void encode(std::span<const SurfacePoint> points, Encoded& e, bool record) const;

  Config config_;
  Vec3f origin_, size_;
  HashGrid grid_;
  DecoderHead decoder_;
  std::unique_ptr<SparseAdam> grid_adam_;
  std::vector<float> upstream_;  // [point][level][feature]
};

extern const FieldEntry kNrField;
std::unique_ptr<DeviceField> make_device_nr(Stream& stream, RadianceField& field, const Config& config,
                                            const DeviceFieldOptions& options);
std::vector<MemoryPart> device_nr_memory(const Config& config, const std::vector<long long>& cells_per_level,
                                         const DeviceFieldOptions& options);

}  // namespace octrad
