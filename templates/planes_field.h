// A radiance field of three feature planes and a decoder, on the CPU only. Template of docs/extending.md.
#pragma once

#include "octrad/encoding/planes.h"
#include "octrad/model/field_base.h"
#include "octrad/model/field_registry.h"

namespace octrad {

extern const FieldEntry kPlanesField;

class PlanesField : public FieldBase {
 public:
  PlanesField(const Config& config, const FieldDomain& domain);

  std::string name() const override { return "planes"; }
  void radiance(std::span<const SurfacePoint> points, std::span<Vec3f> out) const override;
  int feature_count() const override { return planes_.features(); }
  int levels() const override { return 1; }
  void inspect(std::span<const SurfacePoint> points, std::span<float> features,
               std::span<float> disparity) const override;

 protected:
  void differentiate(std::span<const SurfacePoint> points, std::span<const Vec3f> targets, const BatchPart& part,
                     Gradients& gradients) override;

 private:
  struct Encoded;
  void encode(std::span<const SurfacePoint> points, Encoded& e) const;

  Planes planes_;
};

}  // namespace octrad
