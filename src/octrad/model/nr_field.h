// Neural Radiosity (Hadadan et al. 2021) as the paper's authors ran it (method section 9): a hash grid over position
// and a decoder. The baseline for the OctaOctree.
#pragma once

#include <memory>

#include "octrad/encoding/hash_grid.h"
#include "octrad/model/field_base.h"
#include "octrad/model/field_registry.h"

namespace octrad {

// The shapes of its parts.
HashGridOptions nr_grid_options(const Config& config);
MlpShape nr_decoder_shape(const Config& config);

class NrField : public FieldBase {
 public:
  NrField(const Config& config, const FieldDomain& domain);

  std::string name() const override { return "nr"; }
  void radiance(std::span<const SurfacePoint> points, std::span<Vec3f> out) const override;
  int feature_count() const override { return grid_.feature_count(); }
  int levels() const override { return grid_.options().levels; }
  void inspect(std::span<const SurfacePoint> points, std::span<float> features,
               std::span<float> disparity) const override;

  HashGrid& grid() { return grid_; }  // for the counterpart on a device

 protected:
  void differentiate(std::span<const SurfacePoint> points, std::span<const Vec3f> targets, const BatchPart& part,
                     Gradients& gradients) override;

 private:
  struct Encoded;
  void encode(std::span<const SurfacePoint> points, Encoded& e, bool record) const;

  HashGrid grid_;
};

extern const FieldEntry kNrField;
std::unique_ptr<DeviceField> make_device_nr(Stream& stream, RadianceField& field, const Config& config,
                                            const DeviceFieldOptions& options);
std::vector<MemoryPart> device_nr_memory(const Config& config, const std::vector<long long>& cells_per_level,
                                         const DeviceFieldOptions& options);

}  // namespace octrad
