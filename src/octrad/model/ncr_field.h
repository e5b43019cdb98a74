// Neural Cone Radiosity (Ren et al. 2025, arXiv 2509.07522; method section 9): Neural Radiosity for the diffuse part;
// on glossy surfaces also cones to where rays of the BSDF end, looked up in a grid at the size of their footprints.
#pragma once

#include <memory>

#include "octrad/encoding/hash_grid.h"
#include "octrad/model/field_base.h"
#include "octrad/model/field_registry.h"
#include "octrad/model/ncr_math.h"

namespace octrad {

// The shapes of its parts.
HashGridOptions ncr_grid_options(const Config& config);
HashGridOptions ncr_cone_grid_options(const Config& config);
MlpShape ncr_decoder_shape(const Config& config);
MlpShape ncr_cone_shape(const Config& config);
MlpShape ncr_merge_shape(const Config& config);

class NcrField : public FieldBase {
 public:
  NcrField(const Config& config, const FieldDomain& domain);

  std::string name() const override { return "ncr"; }
  void radiance(std::span<const SurfacePoint> points, std::span<Vec3f> out) const override;
  // Features and levels are those of the diffuse branch's grid.
  int feature_count() const override { return grid_.feature_count(); }
  int levels() const override { return grid_.options().levels; }
  void inspect(std::span<const SurfacePoint> points, std::span<float> features,
               std::span<float> disparity) const override;

  // For the counterpart on a device.
  HashGrid& grid() { return grid_; }
  HashGrid& cone_grid() { return cone_grid_; }
  Mlp& cone_mlp() { return cone_mlp_; }
  Mlp& merge_mlp() { return merge_mlp_; }
  const LobeTable& lobe() const { return lobe_; }
  float extent() const { return extent_; }  // largest side: the unit of cones

 protected:
  void differentiate(std::span<const SurfacePoint> points, std::span<const Vec3f> targets, const BatchPart& part,
                     Gradients& gradients) override;

 private:
  struct Encoded;                                         // intermediate values of a chunk of queries
  static constexpr std::size_t kCone = 1, kMerge = 2;     // among the networks
  static constexpr std::size_t kGrid = 0, kConeGrid = 1;  // among the tables

  void encode(std::span<const SurfacePoint> points, Encoded& e, bool record) const;
  void evaluate(std::span<const SurfacePoint> points, Encoded& e, bool record) const;

  float extent_;
  LobeTable lobe_;
  // decoder(): of the diffuse branch; its loss and activation are those of glossy points, too.
  HashGrid grid_, cone_grid_;
  Mlp cone_mlp_, merge_mlp_;
};

extern const FieldEntry kNcrField;
std::unique_ptr<DeviceField> make_device_ncr(Stream& stream, RadianceField& field, const Config& config,
                                             const DeviceFieldOptions& options);
std::vector<MemoryPart> device_ncr_memory(const Config& config, const std::vector<long long>& cells_per_level,
                                          const DeviceFieldOptions& options);

}  // namespace octrad
