#include "octrad/model/ncr_field.h"

#include <algorithm>

#include "octrad/encoding/prefiltered_grid.h"
#include "octrad/model/field_storage.h"
#include "octrad/model/weight_stream.h"

namespace octrad {

HashGridOptions ncr_grid_options(const Config& c) {
  return {c.ncr_levels, c.ncr_features, c.ncr_log2_table, c.ncr_base, c.ncr_scale};
}
HashGridOptions ncr_cone_grid_options(const Config& c) {
  return {c.ncr_cone_levels, c.ncr_cone_features, c.ncr_cone_log2_table, c.ncr_cone_base, c.ncr_cone_scale};
}
MlpShape ncr_decoder_shape(const Config& c) {
  return {c.ncr_levels * c.ncr_features + kPointInputs, c.ncr_width, c.ncr_hidden, 3};
}
MlpShape ncr_cone_shape(const Config& c) {
  return {c.ncr_cone_features + kConePointInputs, c.ncr_cone_width, c.ncr_cone_hidden, 3};
}
MlpShape ncr_merge_shape(const Config& c) { return {kMergeInputs, c.ncr_merge_width, c.ncr_merge_hidden, 3}; }

namespace {

constexpr std::string_view kNcrKeys[] = {"ncr."};

std::vector<MemoryPart> ncr_memory(const Config& config, const std::vector<long long>&, bool training) {
  std::vector<MemoryPart> parts;
  add_table_memory(parts, "diffuse grid", static_cast<double>(hash_grid_entries(ncr_grid_options(config))),
                   config.ncr_features, config, training);
  add_table_memory(parts, "cone grid", static_cast<double>(hash_grid_entries(ncr_cone_grid_options(config))),
                   config.ncr_cone_features, config, training);
  if (training) add_batch_memory(parts, config, config.ncr_levels * 8.0 + config.ncr_clusters * 16.0);
  return parts;
}

QueryRays ncr_rays(const Config& config, bool training) {
  QueryRays rays;
  rays.lobe = training ? config.ncr_rays_train : config.ncr_rays_render;
  rays.lobe_below = static_cast<float>(config.lookup_rough_threshold);
  rays.clusters = config.ncr_clusters;
  rays.iterations = training ? config.ncr_iterations_train : config.ncr_iterations_render;
  return rays;
}

using Rows = std::vector<float>;  // [row][stride]

void resize(Rows& rows, int count, int stride) {
  rows.resize(static_cast<std::size_t>(count) * static_cast<std::size_t>(stride));
}
float& at(Rows& rows, int row, int stride, int i) {
  return rows[static_cast<std::size_t>(row) * static_cast<std::size_t>(stride) + static_cast<std::size_t>(i)];
}
void set3(Rows& rows, int row, int stride, int i, Vec3f v) {
  for (int c = 0; c < 3; ++c) at(rows, row + c, stride, i) = v[c];
}

}  // namespace

constinit const FieldEntry kNcrField = {
    .name = "ncr",
    .title = "Neural Cone Radiosity",
    .own_keys = kNcrKeys,
    .cell_levels = [](const Config&) { return 0; },
    .finest_cells = [](const Config& c) { return hash_grid_resolution(ncr_grid_options(c), c.ncr_levels - 1); },
    .rays = ncr_rays,
    .make = [](const Config& config, const FieldDomain& domain) -> std::unique_ptr<RadianceField> {
      return std::make_unique<NcrField>(config, domain);
    },
    .memory = ncr_memory,
    .make_device = make_device_ncr,
    .device_memory = device_ncr_memory,
    .smaller =
        [](const Config& config) {
          std::vector<std::pair<std::string, std::string>> changes;
          for (const auto& [key, value] : {std::pair{"ncr.log2_table", config.ncr_log2_table},
                                           std::pair{"ncr.cone.log2_table", config.ncr_cone_log2_table}}) {
            if (value > 10) changes.emplace_back(key, std::to_string(value - 1));
          }
          return changes;
        },
};

// A cone is a cluster of hits of a glossy point that is not empty.
struct NcrField::Encoded {
  struct Cone {
    int glossy;  // number of its point among the glossy ones
    int slot;    // number of the cluster at its point
    float share;
  };
  // Of the diffuse branch; those of the merge network replace its linear outputs at glossy points.
  DecoderRows diffuse;
  std::vector<Vec3f> p, w;
  std::vector<Tap> taps;

  std::vector<int> glossy;  // points of the chunk
  int glossy_stride = 0;
  Rows merge_inputs, merge_linear;
  Rows diffuse_slope;  // derivative of the diffuse branch's activation
  Mlp::Workspace merge_kept;

  std::vector<Cone> cones;
  int cone_stride = 0;
  std::vector<Vec3f> cone_p;
  std::vector<float> cone_r;
  Rows cone_inputs, cone_linear;
  PrefilteredRecord cone_record;
  Mlp::Workspace cone_kept;

  Rows d_merge_linear, d_merge_inputs, d_cone_linear, d_cone_inputs;
};

NcrField::NcrField(const Config& config, const FieldDomain& domain)
    : FieldBase(config, domain, "ncr.mlp", ncr_decoder_shape(config), config.ncr_output, kNcrDecoderWeights),
      extent_(max_component(domain.size)),
      lobe_(lobe_table(config.ncr_lobe_share)),
      grid_(ncr_grid_options(config)),
      cone_grid_(ncr_cone_grid_options(config)),
      cone_mlp_(ncr_cone_shape(config)),
      merge_mlp_(ncr_merge_shape(config)) {
  decoder_.set_glossy_activation(Activation::softplus);  // of the merge network
  decoder_.set_chroma(static_cast<float>(config.ncr_chroma));
  const auto seed = static_cast<unsigned long long>(config.seed);
  initialize_hash_grid(grid_, seed, kNcrGridWeights);
  initialize_hash_grid(cone_grid_, seed, kNcrConeGridWeights);
  cone_mlp_.initialize(seed, kNcrConeNetworkWeights);
  merge_mlp_.initialize(seed, kNcrMergeNetworkWeights);
  add_network("ncr.cone.mlp", cone_mlp_);
  add_network("ncr.merge.mlp", merge_mlp_);
  add_grid("ncr.grid", grid_, static_cast<std::size_t>(levels()));
  add_grid("ncr.cone.grid", cone_grid_, kHitClusters);
}

// Fills e.diffuse.inputs for up to kQueryChunk points.
void NcrField::encode(std::span<const SurfacePoint> points, Encoded& e, bool record) const {
  const int n = static_cast<int>(points.size()), features = grid_.feature_count();
  DecoderRows& rows = e.diffuse;
  rows.stride = padded(n);
  e.p.resize(points.size());
  e.w.resize(points.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    e.p[i] = normalized(points[i].x);
    e.w[i] = reflect(points[i].wo, points[i].n);
  }
  resize(rows.inputs, features + kPointInputs, rows.stride);
  if (record) grid_.lookup_record(e.p.data(), n, rows.inputs.data(), rows.stride, e.taps);
  else grid_.lookup(e.p.data(), n, rows.inputs.data(), rows.stride);
  decoder_.fill_inputs(points, e.w.data(), rows.inputs.data(), features, rows.stride);
}

// The whole field, up to the linear outputs.
void NcrField::evaluate(std::span<const SurfacePoint> points, Encoded& e, bool record) const {
  encode(points, e, record);
  const int n = static_cast<int>(points.size());
  DecoderRows& rows = e.diffuse;
  resize(rows.linear, 3, rows.stride);
  if (record) decoder_.mlp().forward(rows.inputs.data(), n, rows.stride, rows.linear.data(), rows.kept);
  else decoder_.mlp().forward(rows.inputs.data(), n, rows.stride, rows.linear.data());

  e.glossy.clear();
  e.cones.clear();
  e.cone_p.clear();
  e.cone_r.clear();
  for (int i = 0; i < n; ++i) {
    const SurfacePoint& point = points[static_cast<std::size_t>(i)];
    if (!(point.alpha < decoder_.rules().rough_threshold)) continue;
    const float tangent = lobe_(point.alpha);
    for (int k = 0; k < config_.ncr_clusters; ++k) {
      const HitCluster& cluster = point.lobe[k];
      if (!(cluster.share > 0.0f)) continue;
      const ConeEnd end = cone_end(point, e.w[static_cast<std::size_t>(i)], cluster, tangent);
      e.cones.push_back({static_cast<int>(e.glossy.size()), k, cluster.share});
      e.cone_p.push_back(end.x);
      e.cone_r.push_back(end.r / extent_);
    }
    e.glossy.push_back(i);
  }
  const int glossy = static_cast<int>(e.glossy.size()), cones = static_cast<int>(e.cones.size());
  if (glossy == 0) return;

  const int features = cone_grid_.options().features;
  e.glossy_stride = padded(glossy);
  e.cone_stride = padded(cones);
  resize(e.merge_inputs, kMergeInputs, e.glossy_stride);
  resize(e.merge_linear, 3, e.glossy_stride);
  resize(e.cone_inputs, features + kConePointInputs, e.cone_stride);
  resize(e.cone_linear, 3, e.cone_stride);
  const DecoderRules& rules = decoder_.rules();
  for (int j = 0; j < cones; ++j) {
    const auto cone = static_cast<std::size_t>(j);
    Vec3f& x = e.cone_p[cone];
    const Vec3f w = e.w[static_cast<std::size_t>(e.glossy[static_cast<std::size_t>(e.cones[cone].glossy)])];
    set3(e.cone_inputs, features, e.cone_stride, j, rules.position(x));
    set3(e.cone_inputs, features + 3, e.cone_stride, j, -w);
    at(e.cone_inputs, features + 6, e.cone_stride, j) = e.cone_r[cone];
    x = (x - origin_) / extent_;
  }
  if (cones > 0) {
    prefiltered_lookup(cone_grid_.view(), e.cone_p.data(), e.cone_r.data(), cones, e.cone_inputs.data(), e.cone_stride,
                       record ? &e.cone_record : nullptr);
    if (record) cone_mlp_.forward(e.cone_inputs.data(), cones, e.cone_stride, e.cone_linear.data(), e.cone_kept);
    else cone_mlp_.forward(e.cone_inputs.data(), cones, e.cone_stride, e.cone_linear.data());
  }
  for (int g = 0; g < glossy; ++g) {
    const int i = e.glossy[static_cast<std::size_t>(g)];
    const SurfacePoint& point = points[static_cast<std::size_t>(i)];
    for (int c = 0; c < 3; ++c) {
      at(e.merge_inputs, c, e.glossy_stride, g) = activate(rules.activation, at(rows.linear, c, rows.stride, i)).value;
      at(e.merge_inputs, 3 + c, e.glossy_stride, g) = 0.0f;
    }
    at(e.merge_inputs, 6, e.glossy_stride, g) = point.alpha;
    set3(e.merge_inputs, 7, e.glossy_stride, g, point.albedo);
  }
  for (int j = 0; j < cones; ++j) {
    const Encoded::Cone& cone = e.cones[static_cast<std::size_t>(j)];
    for (int c = 0; c < 3; ++c) {
      at(e.merge_inputs, 3 + c, e.glossy_stride, cone.glossy) +=
          cone.share * activate(rules.activation, at(e.cone_linear, c, e.cone_stride, j)).value;
    }
  }
  if (record) {
    // Kept for the way back, because the merged outputs take the place of the linear ones.
    resize(e.diffuse_slope, 3, e.glossy_stride);
    for (int g = 0; g < glossy; ++g) {
      for (int c = 0; c < 3; ++c) {
        at(e.diffuse_slope, c, e.glossy_stride, g) =
            activate(rules.activation, at(rows.linear, c, rows.stride, e.glossy[static_cast<std::size_t>(g)]))
                .derivative;
      }
    }
    merge_mlp_.forward(e.merge_inputs.data(), glossy, e.glossy_stride, e.merge_linear.data(), e.merge_kept);
  } else {
    merge_mlp_.forward(e.merge_inputs.data(), glossy, e.glossy_stride, e.merge_linear.data());
  }
  for (int g = 0; g < glossy; ++g) {
    for (int c = 0; c < 3; ++c)
      at(rows.linear, c, rows.stride, e.glossy[static_cast<std::size_t>(g)]) =
          at(e.merge_linear, c, e.glossy_stride, g);
  }
}

void NcrField::radiance(std::span<const SurfacePoint> points, std::span<Vec3f> out) const {
  thread_local Encoded e;
  for_chunks(points, [&](std::span<const SurfacePoint> chunk, std::size_t first) {
    evaluate(chunk, e, false);
    decoder_.activate(chunk, e.diffuse.linear.data(), e.diffuse.stride, out.data() + first);
  });
}

void NcrField::inspect(std::span<const SurfacePoint> points, std::span<float> features,
                       std::span<float> disparity) const {
  Encoded e;
  for_chunks(points, [&](std::span<const SurfacePoint> chunk, std::size_t first) {
    if (features.empty()) return;
    encode(chunk, e, false);
    copy_features(e.diffuse, first, chunk.size(), features);
  });
  std::fill(disparity.begin(), disparity.end(), 0.0f);
}

void NcrField::differentiate(std::span<const SurfacePoint> points, std::span<const Vec3f> targets,
                             const BatchPart& part, Gradients& gradients) {
  thread_local Encoded kept;
  Encoded& e = kept;
  evaluate(points, e, true);
  DecoderRows& rows = e.diffuse;
  decoder_loss(points, targets, part, rows, gradients);
  const Activation activation = decoder_.rules().activation;
  const int glossy = static_cast<int>(e.glossy.size()), cones = static_cast<int>(e.cones.size());
  if (glossy > 0) {
    resize(e.d_merge_linear, 3, e.glossy_stride);
    resize(e.d_merge_inputs, kMergeInputs, e.glossy_stride);
    for (int g = 0; g < glossy; ++g) {
      for (int c = 0; c < 3; ++c)
        at(e.d_merge_linear, c, e.glossy_stride, g) =
            at(rows.d_linear, c, rows.stride, e.glossy[static_cast<std::size_t>(g)]);
    }
    merge_mlp_.backward(e.merge_inputs.data(), e.d_merge_linear.data(), e.merge_kept, gradients.networks[kMerge],
                        e.d_merge_inputs.data());
    for (int g = 0; g < glossy; ++g) {
      for (int c = 0; c < 3; ++c) {
        at(rows.d_linear, c, rows.stride, e.glossy[static_cast<std::size_t>(g)]) =
            at(e.d_merge_inputs, c, e.glossy_stride, g) * at(e.diffuse_slope, c, e.glossy_stride, g);
      }
    }
  }
  if (cones > 0) {
    const int features = cone_grid_.options().features;
    resize(e.d_cone_linear, 3, e.cone_stride);
    resize(e.d_cone_inputs, features + kConePointInputs, e.cone_stride);
    for (int j = 0; j < cones; ++j) {
      const Encoded::Cone& cone = e.cones[static_cast<std::size_t>(j)];
      for (int c = 0; c < 3; ++c) {
        at(e.d_cone_linear, c, e.cone_stride, j) =
            at(e.d_merge_inputs, 3 + c, e.glossy_stride, cone.glossy) * cone.share *
            activate(activation, at(e.cone_linear, c, e.cone_stride, j)).derivative;
      }
    }
    cone_mlp_.backward(e.cone_inputs.data(), e.d_cone_linear.data(), e.cone_kept, gradients.networks[kCone],
                       e.d_cone_inputs.data());
    float* cone_upstream = upstream(kConeGrid).data();
    std::vector<SparseTap>& cone_taps = gradients.tables[kConeGrid];
    for (int j = 0; j < cones; ++j) {
      const Encoded::Cone& cone = e.cones[static_cast<std::size_t>(j)];
      const auto point = part.first + static_cast<std::size_t>(e.glossy[static_cast<std::size_t>(cone.glossy)]);
      const auto source = static_cast<std::uint32_t>(point * kHitClusters + static_cast<std::size_t>(cone.slot));
      float* to = cone_upstream + std::size_t{source} * static_cast<std::size_t>(features);
      for (int f = 0; f < features; ++f) to[f] = at(e.d_cone_inputs, f, e.cone_stride, j);
      const Tap* taps = e.cone_record.taps.data() + static_cast<std::size_t>(j) * 16;
      const int count = e.cone_record.blends[static_cast<std::size_t>(j)].weight < 1.0f ? 16 : 8;
      for (int t = 0; t < count; ++t) cone_taps.push_back({taps[t].entry, source, taps[t].weight});
    }
  }
  decoder_backward(rows, gradients);
  add_grid_taps(grid_, e.taps, rows.d_inputs, rows.stride, points.size(), part.first, upstream(kGrid),
                gradients.tables[kGrid]);
}

}  // namespace octrad
