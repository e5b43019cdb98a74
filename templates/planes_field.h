// A radiance field of three feature planes and a decoder, on the CPU only. Template of docs/extending.md.
#pragma once

#include <memory>

#include "octrad/encoding/planes.h"
#include "octrad/model/decoder_head.h"
#include "octrad/model/field_registry.h"

namespace octrad {

extern const FieldEntry kPlanesField;

class PlanesField : public RadianceField {
 public:
  PlanesField(const Config& config, const FieldDomain& domain);

  std::string name() const override { return "planes"; }
  void radiance(std::span<const SurfacePoint> points, std::span<Vec3f> out) const override;
  FieldStep train(std::span<const SurfacePoint> points, std::span<const Vec3f> targets, double epsilon,
                  RateScale scale) override;
  void set_target_scale(float scale) override { decoder_.set_target_scale(scale); }
  float target_scale() const override { return decoder_.target_scale(); }
  Vec3f normalized(Vec3f x) const override { return (x - origin_) / size_; }
  int feature_count() const override { return planes_.features(); }
  int levels() const override { return 1; }
  void inspect(std::span<const SurfacePoint> points, std::span<float> features,
               std::span<float> disparity) const override;
  std::vector<WeightArray> weights() override;
  void weights_changed() override;
  void save(TensorWriter& out) override;
  void save_optimizer(TensorWriter& out) override;
  void load(const TensorReader& in) override;
  void load_optimizer(const TensorReader& in) override;

 private:
  struct Encoded;
  void encode(std::span<const SurfacePoint> points, Encoded& e) const;
  void make_optimizer();

  Config config_;
  Vec3f origin_, size_;
  Planes planes_;
  DecoderHead decoder_;
  std::unique_ptr<SparseAdam> adam_;  // of the planes; null before training
};

}  // namespace octrad
