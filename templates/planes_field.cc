#include "octrad/model/planes_field.h"

#include <algorithm>

#include "octrad/base/rng.h"
#include "octrad/model/field_storage.h"

namespace octrad {
namespace {

constexpr int kFeatures = 8, kWidth = 64, kHidden = 3;

double entries(const Config& config) { return 3.0 * config.planes_resolution * config.planes_resolution; }

constexpr std::string_view kPlanesKeys[] = {"planes."};

}  // namespace

constinit const FieldEntry kPlanesField = {
    .name = "planes",
    .title = "three feature planes",
    .own_keys = kPlanesKeys,
    .cell_levels = [](const Config&) { return 0; },
    .make = [](const Config& config, const FieldDomain& domain) -> std::unique_ptr<RadianceField> {
      return std::make_unique<PlanesField>(config, domain);
    },
    .memory =
        [](const Config& config, const std::vector<long long>&, bool training) {
          std::vector<MemoryPart> parts;
          add_table_memory(parts, "planes", entries(config), kFeatures, config, training);
          if (training) add_batch_memory(parts, config, kPlaneTaps);
          return parts;
        },
    .make_device = nullptr,
    .device_memory = nullptr,
    .smaller = [](const Config&) { return std::vector<std::pair<std::string, std::string>>{}; },
};

// What is known of a chunk of points on its way through the field.
struct PlanesField::Encoded {
  DecoderRows rows;
  std::vector<Vec3f> p, w;
  std::vector<Tap> taps;
};

PlanesField::PlanesField(const Config& config, const FieldDomain& domain)
    : FieldBase(config, domain, "planes.mlp", {kFeatures + kPointInputs, kWidth, kHidden, 3}, Activation::exp,
                6),  // model/weight_stream.h
      planes_(config.planes_resolution, kFeatures) {
  Rng rng(static_cast<unsigned long long>(config.seed), RngPurpose::weights, 7);
  for (float& v : planes_.table()) v = 1e-2f * (2.0f * rng.uniform() - 1.0f);
  add_table("planes.grid", planes_.table(), kFeatures, config.adam_rate_grids, 1);
}

void PlanesField::encode(std::span<const SurfacePoint> points, Encoded& e) const {
  const int n = static_cast<int>(points.size());
  const int stride = e.rows.stride = padded(n);
  e.p.clear();
  e.w.clear();
  for (const SurfacePoint& point : points) {
    e.p.push_back(normalized(point.x));
    e.w.push_back(reflect(point.wo, point.n));
  }
  e.rows.inputs.resize((kFeatures + kPointInputs) * static_cast<std::size_t>(stride));
  e.taps.resize(points.size() * kPlaneTaps);
  planes_.lookup(e.p.data(), n, e.rows.inputs.data(), stride, e.taps.data());
  decoder_.fill_inputs(points, e.w.data(), e.rows.inputs.data(), kFeatures, stride);
}

void PlanesField::radiance(std::span<const SurfacePoint> points, std::span<Vec3f> out) const {
  thread_local Encoded e;
  for_chunks(points, [&](std::span<const SurfacePoint> chunk, std::size_t first) {
    encode(chunk, e);
    decode(chunk, e.rows, out.data() + first);
  });
}

void PlanesField::inspect(std::span<const SurfacePoint> points, std::span<float> features,
                          std::span<float> disparity) const {
  Encoded e;
  for_chunks(points, [&](std::span<const SurfacePoint> chunk, std::size_t first) {
    if (features.empty()) return;
    encode(chunk, e);
    copy_features(e.rows, first, chunk.size(), features);
  });
  std::fill(disparity.begin(), disparity.end(), 0.0f);
}

void PlanesField::differentiate(std::span<const SurfacePoint> points, std::span<const Vec3f> targets,
                                const BatchPart& part, Gradients& gradients) {
  thread_local Encoded kept;
  Encoded& e = kept;
  encode(points, e);
  differentiate_decoder(points, targets, part, e.rows, gradients);
  float* to = upstream(0).data();
  for (std::size_t i = 0; i < points.size(); ++i) {
    const std::size_t source = part.first + i;
    for (std::size_t f = 0; f < kFeatures; ++f)
      to[source * kFeatures + f] = e.rows.d_inputs[f * static_cast<std::size_t>(e.rows.stride) + i];
    for (std::size_t k = 0; k < kPlaneTaps; ++k) {
      const Tap& tap = e.taps[i * kPlaneTaps + k];
      gradients.tables[0].push_back({tap.entry, static_cast<std::uint32_t>(source), tap.weight});
    }
  }
}

}  // namespace octrad
