// For tests: a field that answers the same radiance everywhere and learns nothing.
#pragma once

#include <algorithm>

#include "octrad/model/radiance_field.h"

namespace octrad::testing {

class ConstantField : public RadianceField {
 public:
  explicit ConstantField(Vec3f value) : value_(value) {}
  std::string name() const override { return "constant"; }
  void radiance(std::span<const SurfacePoint> points, std::span<Vec3f> out) const override {
    std::fill_n(out.begin(), points.size(), value_);
  }
  FieldStep train(std::span<const SurfacePoint>, std::span<const Vec3f>, double, RateScale) override { return {}; }
  void set_target_scale(float) override {}
  float target_scale() const override { return 1.0f; }
  Vec3f normalized(Vec3f x) const override { return x * 0.4f + Vec3f(0.5f); }
  int feature_count() const override { return 8; }
  bool uses_disparity() const override { return true; }
  int levels() const override { return 2; }
  void inspect(std::span<const SurfacePoint> points, std::span<float> features,
               std::span<float> disparity) const override {
    for (std::size_t i = 0; i < points.size(); ++i) {
      for (std::size_t f = 0; f < 8 && !features.empty(); ++f)
        features[i * 8 + f] = points[i].x.x * static_cast<float>(f) + points[i].x.y;
      if (!disparity.empty()) disparity[i] = 0.25f;
    }
  }
  std::vector<WeightArray> weights() override { return {}; }
  void weights_changed() override {}
  void save(TensorWriter&) override {}
  void save_optimizer(TensorWriter&) override {}
  void load(const TensorReader&) override {}
  void load_optimizer(const TensorReader&) override {}

 private:
  Vec3f value_;
};

}  // namespace octrad::testing
