// Neural Radiosity on a device (method section 9).
#include "octrad/model/field_base_device.h"
#include "octrad/model/nr_field.h"

namespace octrad {
namespace {

class DeviceNrField : public DeviceFieldBase {
 public:
  DeviceNrField(Stream& stream, NrField& field, const Config& config, const DeviceFieldOptions& options)
      : DeviceFieldBase(stream, field, config, options),
        grid_(field.grid(), field.origin(), field.size()),
        table_(stream, static_cast<std::size_t>(field.grid().entry_count()), field.grid().options().features,
               table_options(config, options, field.levels(), kHashGridTaps), "hash grid") {
    holds(field, {}, {&table_});
    upload_from(field);
  }

 protected:
  void encode(const Chunk& chunk) override {
    grid_.lookup(stream_, read(table_), queries(chunk), HalfRows{inputs_.data(), rows_}, 0);
  }
  void encode_backward(const Chunk& chunk, bool) override {
    scatter(
        table_, [&](const auto& sink) { grid_.scatter(stream_, queries(chunk), d_inputs_.data(), train_rows_, sink); },
        kHashGridTaps, chunk.n, grid_.levels(), d_inputs_.data(), train_rows_);
  }
  void features(const Chunk& chunk, FloatRows out) override {
    grid_.lookup(stream_, read(table_), queries(chunk), out, 0);
  }

 private:
  DeviceHashGrid grid_;
  DeviceTable table_;
};

}  // namespace

std::unique_ptr<DeviceField> make_device_nr(Stream& stream, RadianceField& field, const Config& config,
                                            const DeviceFieldOptions& options) {
  return std::make_unique<DeviceNrField>(stream, dynamic_cast<NrField&>(field), config, options);
}

std::vector<MemoryPart> device_nr_memory(const Config& config, const std::vector<long long>&,
                                         const DeviceFieldOptions& options) {
  using Base = DeviceFieldBase;
  std::vector<MemoryPart> parts = Base::decoder_memory(nr_decoder_shape(config), options);
  append(parts,
         DeviceTable::memory(static_cast<std::size_t>(hash_grid_entries(nr_grid_options(config))), config.nr_features,
                             Base::table_options(config, options, config.nr_levels, kHashGridTaps), "hash grid"));
  return parts;
}

}  // namespace octrad
