#include "octrad/model/ncr_field.h"

#include <algorithm>

#include "octrad/base/threads.h"
#include "octrad/encoding/prefiltered_grid.h"
#include "octrad/model/weight_stream.h"

namespace octrad {

HashGridOptions ncr_grid_options(const Config& c) {
  return {c.ncr_levels, c.ncr_features, c.ncr_log2_table, c.ncr_base, c.ncr_scale};
}
HashGridOptions ncr_cone_grid_options(const Config& c) {
  return {c.ncr_cone_levels, c.ncr_cone_features, c.ncr_cone_log2_table, c.ncr_cone_base, c.ncr_cone_scale};
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
  int stride = 0;
  std::vector<Vec3f> p, w;
  Rows inputs;
  Rows linear;  // outputs of the diffuse branch, which those of the merge network replace at glossy points
  std::vector<Tap> taps;
  Mlp::Workspace kept;

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

  Rows d_linear, d_inputs, d_merge_linear, d_merge_inputs, d_cone_linear, d_cone_inputs;
};

struct NcrField::Gradients {
  std::vector<float> decoder, cone, merge;
  std::vector<SparseTap> grid, cone_grid;
  double loss = 0.0;
  long long non_finite = 0;
};

NcrField::NcrField(const Config& config, const FieldDomain& domain)
    : config_(config),
      origin_(domain.origin),
      size_(domain.size),
      extent_(max_component(domain.size)),
      lobe_(lobe_table(config.ncr_lobe_share)),
      grid_(ncr_grid_options(config)),
      decoder_(config, grid_.feature_count(), config.ncr_width, config.ncr_hidden, config.ncr_output, domain.origin,
               domain.size, kNcrDecoderWeights),
      cone_grid_(ncr_cone_grid_options(config)),
      cone_mlp_(ncr_cone_shape(config)),
      merge_mlp_(ncr_merge_shape(config)),
      cone_adam_(cone_mlp_.parameter_count(), adam_options(config)),
      merge_adam_(merge_mlp_.parameter_count(), adam_options(config)) {
  decoder_.set_glossy_activation(Activation::softplus);  // of the merge network
  decoder_.set_chroma(static_cast<float>(config.ncr_chroma));
  const auto seed = static_cast<unsigned long long>(config.seed);
  initialize_hash_grid(grid_, seed, kNcrGridWeights);
  initialize_hash_grid(cone_grid_, seed, kNcrConeGridWeights);
  cone_mlp_.initialize(seed, kNcrConeNetworkWeights);
  merge_mlp_.initialize(seed, kNcrMergeNetworkWeights);
}

// Fills e.inputs of the diffuse branch for up to kQueryChunk points.
void NcrField::encode(std::span<const SurfacePoint> points, Encoded& e, bool record) const {
  const int n = static_cast<int>(points.size()), features = grid_.feature_count();
  e.stride = padded(n);
  e.p.resize(points.size());
  e.w.resize(points.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    e.p[i] = normalized(points[i].x);
    e.w[i] = reflect(points[i].wo, points[i].n);
  }
  resize(e.inputs, features + kPointInputs, e.stride);
  if (record) grid_.lookup_record(e.p.data(), n, e.inputs.data(), e.stride, e.taps);
  else grid_.lookup(e.p.data(), n, e.inputs.data(), e.stride);
  decoder_.fill_inputs(points, e.w.data(), e.inputs.data(), features, e.stride);
}

// The whole field, up to the linear outputs e.linear.
void NcrField::evaluate(std::span<const SurfacePoint> points, Encoded& e, bool record) const {
  encode(points, e, record);
  const int n = static_cast<int>(points.size());
  resize(e.linear, 3, e.stride);
  if (record) decoder_.mlp().forward(e.inputs.data(), n, e.stride, e.linear.data(), e.kept);
  else decoder_.mlp().forward(e.inputs.data(), n, e.stride, e.linear.data());

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
      at(e.merge_inputs, c, e.glossy_stride, g) = activate(rules.activation, at(e.linear, c, e.stride, i)).value;
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
            activate(rules.activation, at(e.linear, c, e.stride, e.glossy[static_cast<std::size_t>(g)])).derivative;
      }
    }
    merge_mlp_.forward(e.merge_inputs.data(), glossy, e.glossy_stride, e.merge_linear.data(), e.merge_kept);
  } else {
    merge_mlp_.forward(e.merge_inputs.data(), glossy, e.glossy_stride, e.merge_linear.data());
  }
  for (int g = 0; g < glossy; ++g) {
    for (int c = 0; c < 3; ++c)
      at(e.linear, c, e.stride, e.glossy[static_cast<std::size_t>(g)]) = at(e.merge_linear, c, e.glossy_stride, g);
  }
}

void NcrField::radiance(std::span<const SurfacePoint> points, std::span<Vec3f> out) const {
  thread_local Encoded e;
  for (std::size_t begin = 0; begin < points.size(); begin += kQueryChunk) {
    const auto chunk = points.subspan(begin, std::min<std::size_t>(kQueryChunk, points.size() - begin));
    evaluate(chunk, e, false);
    decoder_.activate(chunk, e.linear.data(), e.stride, out.data() + begin);
  }
}

void NcrField::inspect(std::span<const SurfacePoint> points, std::span<float> features,
                       std::span<float> disparity) const {
  Encoded e;
  const auto count = static_cast<std::size_t>(feature_count());
  for (std::size_t begin = 0; begin < points.size() && !features.empty(); begin += kQueryChunk) {
    const auto chunk = points.subspan(begin, std::min<std::size_t>(kQueryChunk, points.size() - begin));
    encode(chunk, e, false);
    copy_features(e.inputs, e.stride, chunk.size(), count, features.data() + begin * count);
  }
  std::fill(disparity.begin(), disparity.end(), 0.0f);
}

// e.d_linear holds the gradient at the linear outputs; `first` is the chunk's first point within the batch.
void NcrField::backward(std::size_t points, std::size_t first, Encoded& e, Gradients& gradients) {
  const Activation activation = decoder_.rules().activation;
  const int glossy = static_cast<int>(e.glossy.size()), cones = static_cast<int>(e.cones.size());
  if (glossy > 0) {
    resize(e.d_merge_linear, 3, e.glossy_stride);
    resize(e.d_merge_inputs, kMergeInputs, e.glossy_stride);
    for (int g = 0; g < glossy; ++g) {
      for (int c = 0; c < 3; ++c)
        at(e.d_merge_linear, c, e.glossy_stride, g) =
            at(e.d_linear, c, e.stride, e.glossy[static_cast<std::size_t>(g)]);
    }
    merge_mlp_.backward(e.merge_inputs.data(), e.d_merge_linear.data(), e.merge_kept, gradients.merge,
                        e.d_merge_inputs.data());
    for (int g = 0; g < glossy; ++g) {
      for (int c = 0; c < 3; ++c) {
        at(e.d_linear, c, e.stride, e.glossy[static_cast<std::size_t>(g)]) =
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
    cone_mlp_.backward(e.cone_inputs.data(), e.d_cone_linear.data(), e.cone_kept, gradients.cone,
                       e.d_cone_inputs.data());
    for (int j = 0; j < cones; ++j) {
      const Encoded::Cone& cone = e.cones[static_cast<std::size_t>(j)];
      const auto point = first + static_cast<std::size_t>(e.glossy[static_cast<std::size_t>(cone.glossy)]);
      const auto source = static_cast<std::uint32_t>(point * kHitClusters + static_cast<std::size_t>(cone.slot));
      float* upstream = cone_upstream_.data() + std::size_t{source} * static_cast<std::size_t>(features);
      for (int f = 0; f < features; ++f) upstream[f] = at(e.d_cone_inputs, f, e.cone_stride, j);
      const Tap* taps = e.cone_record.taps.data() + static_cast<std::size_t>(j) * 16;
      const int count = e.cone_record.blends[static_cast<std::size_t>(j)].weight < 1.0f ? 16 : 8;
      for (int t = 0; t < count; ++t) gradients.cone_grid.push_back({taps[t].entry, source, taps[t].weight});
    }
  }
  resize(e.d_inputs, decoder_.mlp().shape().inputs, e.stride);
  decoder_.mlp().backward(e.inputs.data(), e.d_linear.data(), e.kept, gradients.decoder, e.d_inputs.data());
  add_grid_taps(grid_, e.taps, e.d_inputs, e.stride, points, first, upstream_, gradients.grid);
}

void NcrField::make_optimizers() {
  if (grid_adam_) return;
  grid_adam_ = make_table_adam(grid_.entry_count(), grid_.options().features, config_);
  cone_grid_adam_ = make_table_adam(cone_grid_.entry_count(), cone_grid_.options().features, config_);
}

FieldStep NcrField::train(std::span<const SurfacePoint> points, std::span<const Vec3f> targets, double epsilon,
                          RateScale scale) {
  make_optimizers();
  const std::size_t n = points.size();
  upstream_.resize(n * static_cast<std::size_t>(feature_count()));
  cone_upstream_.resize(n * kHitClusters * static_cast<std::size_t>(cone_grid_.options().features));
  const GroupedBatch groups(n);
  std::vector<Gradients> gradients(groups.count());
  parallel_for(groups.count(), [&](std::size_t g) {
    thread_local Encoded e;
    Gradients& mine = gradients[g];
    mine.decoder.assign(decoder_.mlp().parameter_count(), 0.0f);
    mine.cone.assign(cone_mlp_.parameter_count(), 0.0f);
    mine.merge.assign(merge_mlp_.parameter_count(), 0.0f);
    for (std::size_t begin = groups.begin(g); begin < groups.end(g); begin += kQueryChunk) {
      const std::size_t count = std::min<std::size_t>(kQueryChunk, groups.end(g) - begin);
      const auto chunk = points.subspan(begin, count);
      evaluate(chunk, e, true);
      resize(e.d_linear, 3, e.stride);
      mine.loss += decoder_.loss(chunk, targets.subspan(begin, count), e.linear.data(), e.stride, n, epsilon,
                                 e.d_linear.data(), mine.non_finite);
      backward(count, begin, e, mine);
    }
  });
  FieldStep step;
  std::vector<std::span<const float>> decoder, cone, merge;
  std::vector<std::span<const SparseTap>> grid, cone_grid;
  for (const Gradients& g : gradients) {
    decoder.push_back(g.decoder);
    cone.push_back(g.cone);
    merge.push_back(g.merge);
    grid.push_back(g.grid);
    cone_grid.push_back(g.cone_grid);
    step.loss += g.loss / (3.0 * static_cast<double>(n));
    step.non_finite += g.non_finite;
  }
  const double networks = config_.adam_rate_networks * scale.networks, grids = config_.adam_rate_grids * scale.tables;
  step.non_finite += step_mlp(decoder_.mlp(), decoder_.adam(), decoder, networks);
  step.non_finite += step_mlp(cone_mlp_, cone_adam_, cone, networks);
  step.non_finite += step_mlp(merge_mlp_, merge_adam_, merge, networks);
  for (const auto& done : {grid_adam_->step(grid_.table(), grid, upstream_, grids),
                           cone_grid_adam_->step(cone_grid_.table(), cone_grid, cone_upstream_, grids)}) {
    step.touched += done.touched;
    step.non_finite += done.non_finite;
  }
  return step;
}

std::vector<WeightArray> NcrField::weights() {
  return {{"ncr.grid.table", grid_.table()},
          {"ncr.mlp", decoder_.mlp().weights()},
          {"ncr.cone.grid.table", cone_grid_.table()},
          {"ncr.cone.mlp", cone_mlp_.weights()},
          {"ncr.merge.mlp", merge_mlp_.weights()}};
}

void NcrField::weights_changed() {
  for (Mlp* mlp : {&decoder_.mlp(), &cone_mlp_, &merge_mlp_}) mlp->prepare();
}

void NcrField::save(TensorWriter& out) {
  out.add("octree.origin", DType::f32, {3}, &origin_);
  out.add("octree.size", DType::f32, {3}, &size_);
  save_hash_grid(out, "ncr.grid", grid_);
  save_mlp(out, "ncr.mlp", decoder_.mlp());
  save_hash_grid(out, "ncr.cone.grid", cone_grid_);
  save_mlp(out, "ncr.cone.mlp", cone_mlp_);
  save_mlp(out, "ncr.merge.mlp", merge_mlp_);
}

void NcrField::save_optimizer(TensorWriter& out) {
  make_optimizers();
  save_adam(out, "ncr.mlp", decoder_.adam());
  save_adam(out, "ncr.cone.mlp", cone_adam_);
  save_adam(out, "ncr.merge.mlp", merge_adam_);
  save_adam(out, "ncr.grid", *grid_adam_, grid_.entry_count(), grid_.options().features);
  save_adam(out, "ncr.cone.grid", *cone_grid_adam_, cone_grid_.entry_count(), cone_grid_.options().features);
}

void NcrField::load(const TensorReader& in) {
  load_hash_grid(in, "ncr.grid", grid_);
  load_mlp(in, "ncr.mlp", decoder_.mlp());
  load_hash_grid(in, "ncr.cone.grid", cone_grid_);
  load_mlp(in, "ncr.cone.mlp", cone_mlp_);
  load_mlp(in, "ncr.merge.mlp", merge_mlp_);
}

void NcrField::load_optimizer(const TensorReader& in) {
  make_optimizers();
  load_adam(in, "ncr.mlp", decoder_.adam());
  load_adam(in, "ncr.cone.mlp", cone_adam_);
  load_adam(in, "ncr.merge.mlp", merge_adam_);
  load_adam(in, "ncr.grid", *grid_adam_, grid_.entry_count(), grid_.options().features);
  load_adam(in, "ncr.cone.grid", *cone_grid_adam_, cone_grid_.entry_count(), cone_grid_.options().features);
}

}  // namespace octrad
