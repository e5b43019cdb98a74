#include "octrad/model/nr_field.h"

#include <algorithm>

#include "octrad/model/field_storage.h"
#include "octrad/model/weight_stream.h"

namespace octrad {
namespace {

constexpr std::string_view kNrKeys[] = {"nr."};

std::vector<MemoryPart> nr_memory(const Config& config, const std::vector<long long>&, bool training) {
  std::vector<MemoryPart> parts;
  add_table_memory(parts, "hash grid", static_cast<double>(hash_grid_entries(nr_grid_options(config))),
                   config.nr_features, config, training);
  if (training) add_batch_memory(parts, config, config.nr_levels * 8.0);
  return parts;
}

}  // namespace

constinit const FieldEntry kNrField = {
    .name = "nr",
    .title = "Neural Radiosity (a hash grid)",
    .own_keys = kNrKeys,
    .cell_levels = [](const Config&) { return 0; },
    .finest_cells =
        [](const Config& config) { return hash_grid_resolution(nr_grid_options(config), config.nr_levels - 1); },
    .make = [](const Config& config, const FieldDomain& domain) -> std::unique_ptr<RadianceField> {
      return std::make_unique<NrField>(config, domain);
    },
    .memory = nr_memory,
    .make_device = make_device_nr,
    .device_memory = device_nr_memory,
    .smaller =
        [](const Config& config) {
          std::vector<std::pair<std::string, std::string>> changes;
          if (config.nr_log2_table > 10)
            changes.emplace_back("nr.log2_table", std::to_string(config.nr_log2_table - 1));
          return changes;
        },
};

HashGridOptions nr_grid_options(const Config& config) {
  return {config.nr_levels, config.nr_features, config.nr_log2_table, config.nr_base, config.nr_scale};
}

MlpShape nr_decoder_shape(const Config& config) {
  return {config.nr_levels * config.nr_features + kPointInputs, config.nr_width, config.nr_hidden, 3};
}

struct NrField::Encoded {
  DecoderRows rows;
  std::vector<Vec3f> p, w;
  std::vector<Tap> taps;
};

NrField::NrField(const Config& config, const FieldDomain& domain)
    : FieldBase(config, domain, "nr.mlp", nr_decoder_shape(config), config.nr_output, kNrDecoderWeights),
      grid_(nr_grid_options(config)) {
  initialize_hash_grid(grid_, static_cast<unsigned long long>(config.seed), kNrGridWeights);
  add_grid("nr.grid", grid_, static_cast<std::size_t>(levels()));
}

void NrField::encode(std::span<const SurfacePoint> points, Encoded& e, bool record) const {
  const int n = static_cast<int>(points.size());
  const int stride = e.rows.stride = padded(n);
  e.p.resize(points.size());
  e.w.resize(points.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    e.p[i] = normalized(points[i].x);
    e.w[i] = reflect(points[i].wo, points[i].n);
  }
  const int features = grid_.feature_count();
  e.rows.inputs.resize(static_cast<std::size_t>(features + kPointInputs) * static_cast<std::size_t>(stride));
  float* inputs = e.rows.inputs.data();
  if (record) grid_.lookup_record(e.p.data(), n, inputs, stride, e.taps);
  else grid_.lookup(e.p.data(), n, inputs, stride);
  decoder_.fill_inputs(points, e.w.data(), inputs, features, stride);
}

void NrField::radiance(std::span<const SurfacePoint> points, std::span<Vec3f> out) const {
  thread_local Encoded e;
  for_chunks(points, [&](std::span<const SurfacePoint> chunk, std::size_t first) {
    encode(chunk, e, false);
    decode(chunk, e.rows, out.data() + first);
  });
}

void NrField::inspect(std::span<const SurfacePoint> points, std::span<float> features,
                      std::span<float> disparity) const {
  Encoded e;
  for_chunks(points, [&](std::span<const SurfacePoint> chunk, std::size_t first) {
    if (features.empty()) return;
    encode(chunk, e, false);
    copy_features(e.rows, first, chunk.size(), features);
  });
  std::fill(disparity.begin(), disparity.end(), 0.0f);
}

void NrField::differentiate(std::span<const SurfacePoint> points, std::span<const Vec3f> targets, const BatchPart& part,
                            Gradients& gradients) {
  thread_local Encoded kept;
  Encoded& e = kept;
  encode(points, e, true);
  differentiate_decoder(points, targets, part, e.rows, gradients);
  add_grid_taps(grid_, e.taps, e.rows.d_inputs, e.rows.stride, points.size(), part.first, upstream(0),
                gradients.tables[0]);
}

}  // namespace octrad
