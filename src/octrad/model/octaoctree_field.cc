#include "octrad/model/octaoctree_field.h"

#include <algorithm>
#include <numeric>

#include "octrad/base/threads.h"
#include "octrad/encoding/spherical_harmonics_math.h"
#include "octrad/model/reflected_math.h"
#include "octrad/model/weight_stream.h"
#include "octrad/network/activations_math.h"

namespace octrad {
namespace {

OctaOctreeOptions octree_options(const Config& config) {
  return {octree_levels(config), config.octree_features, config.octree_interpolation == OctreeInterpolation::trilinear,
          config.octa_interpolation == OctaInterpolation::barycentric, config.octree_fine};
}

constexpr std::string_view kOctaOctreeKeys[] = {"octree.levels",          "octree.fine",
                                                "octree.features",        "octree.occupancy",
                                                "octree.interpolation",   "octa.",
                                                "lookup.direction",       "lookup.offset",
                                                "lookup.rough_offset",    "lookup.reflected",
                                                "lookup.rough_direction", "disparity.",
                                                "decoder.width",          "decoder.hidden",
                                                "decoder.output",         "adam.rate.features",
                                                "adam.rate.budget",       "render.offset_spread"};

std::vector<MemoryPart> octaoctree_memory(const Config& config, const std::vector<long long>& cells_per_level,
                                          bool training) {
  std::vector<MemoryPart> parts;
  const auto entries = static_cast<double>(octree_entries(config.octree_levels, cells_per_level));
  const auto cells = static_cast<double>(std::accumulate(cells_per_level.begin(), cells_per_level.end(), 0LL));
  add_table_memory(parts, "octree", entries, config.octree_features, config, training);
  add_table_memory(parts, "disparity grid", static_cast<double>(hash_grid_entries(disparity_grid_options(config))),
                   config.disparity_features, config, training);
  const bool averages = training && config.train_average > 0.0;  // have an octree of their own
  parts.push_back({"octree cells and index", static_cast<std::uint64_t>(cells * (averages ? 56.0 : 28.0))});
  // About 40 of the 64 cells of a query hold surfaces.
  const double lookups = looks_up_reflected(config) ? 2.0 : 1.0;
  if (training)
    add_batch_memory(
        parts, config,
        lookups * (config.octree_levels * 24.0 + config.octree_fine * 8.0) * 0.65 + config.disparity_levels * 8.0);
  return parts;
}

std::vector<std::pair<std::string, std::string>> smaller_octaoctrees(const Config& config) {
  std::vector<std::pair<std::string, std::string>> changes;
  if (config.octree_levels > 1) changes.emplace_back("octree.levels", std::to_string(config.octree_levels - 1));
  if (config.octree_features > 2) changes.emplace_back("octree.features", std::to_string(config.octree_features / 2));
  return changes;
}

float* row(std::vector<float>& rows, int r, int stride) {
  return rows.data() + static_cast<std::ptrdiff_t>(r) * stride;
}

}  // namespace

constinit const FieldEntry kOctaOctreeField = {
    .name = "octaoctree",
    .title = "OctaOctree",
    .own_keys = kOctaOctreeKeys,
    .cell_levels = octree_levels,
    .finest_cells = [](const Config& config) { return static_cast<double>(spatial_resolution(octree_levels(config))); },
    .rays =
        [](const Config& config, bool) {
          QueryRays rays;
          rays.offset = {config.lookup_offset == LookupOffset::traced, octrad::lookup_rule(config),
                         looks_up_reflected(config)};
          return rays;
        },
    .make = [](const Config& config, const FieldDomain& domain) -> std::unique_ptr<RadianceField> {
      return std::make_unique<OctaOctreeField>(config, domain);
    },
    .memory = octaoctree_memory,
    .make_device = make_device_octaoctree,
    .device_memory = device_octaoctree_memory,
    .smaller = smaller_octaoctrees,
};

HashGridOptions disparity_grid_options(const Config& config) {
  return {config.disparity_levels, config.disparity_features, config.disparity_log2_table, config.disparity_base,
          config.disparity_scale};
}

MlpShape disparity_shape(const Config& config) {
  const int inputs =
      config.disparity_levels * config.disparity_features + (config.disparity_direction ? kSphericalHarmonics : 0);
  return {inputs, config.disparity_width, config.disparity_hidden, 1};
}

MlpShape decoder_shape(const Config& config) {
  const int features = octree_levels(config) * config.octree_features;
  return {features + (looks_up_reflected(config) ? features + kReflectedInputs : 0) + kPointInputs,
          config.decoder_width, config.decoder_hidden, 3};
}

struct OctaOctreeField::Encoded {
  int stride = 0;
  std::vector<Vec3f> x, p, w;
  std::vector<int> shifted;  // points that have an offset; disparity_* and grid_taps are of these
  int shifted_stride = 0;
  std::vector<Vec3f> shifted_p;
  std::vector<float> disparity, disparity_inputs, disparity_linear, inputs, linear;
  std::vector<float> d_linear, d_inputs, d_disparity_linear, d_disparity_inputs;
  OctaOctree::Record record;
  // Look-ups at reflected surfaces, of the points `reflected`.
  std::vector<int> reflected;
  int reflected_stride = 0;
  std::vector<Vec3f> reflected_x, reflected_w;
  std::vector<float> reflected_d, reflected_features;
  OctaOctree::Record reflected_record;
  std::vector<Tap> grid_taps;
  Mlp::Workspace decoder_kept, disparity_kept;
};

struct OctaOctreeField::Gradients {
  std::vector<float> decoder, disparity;
  std::vector<SparseTap> octree, grid;
  double loss = 0.0;
  long long non_finite = 0;
};

OctaOctreeField::OctaOctreeField(const Config& config, const FieldDomain& domain)
    : config_(config),
      origin_(domain.origin),
      size_(domain.size),
      rule_(octrad::lookup_rule(config)),
      offset_(config.lookup_offset),
      disparity_unit_(config.disparity_unit == DisparityUnit::extent ? 1.0f / max_component(domain.size) : 1.0f),
      octree_(octree_options(config), domain.occupied_cells, domain.origin, domain.size),
      grid_(disparity_grid_options(config)),
      disparity_(disparity_shape(config)),
      reflects_(looks_up_reflected(config)),
      decoder_(config, decoder_shape(config).inputs - kPointInputs, config.decoder_width, config.decoder_hidden,
               config.decoder_output, domain.origin, domain.size, kDecoderWeights),
      disparity_adam_(disparity_.parameter_count(), adam_options(config)) {
  const auto seed = static_cast<unsigned long long>(config.seed);
  disparity_.initialize(seed, kDisparityNetworkWeights);
  disparity_.prepare();
  initialize_hash_grid(grid_, seed, kDisparityGridWeights);
}

// Fills e.disparity of the points e.shifted, for which alone the predictor is asked.
void OctaOctreeField::predict_disparity(Encoded& e, bool record) const {
  const int n = static_cast<int>(e.shifted.size()), stride = e.shifted_stride = padded(n);
  if (n == 0) return;
  const int grid_rows = grid_.feature_count(), rows = disparity_.shape().inputs;
  const auto s = static_cast<std::size_t>(stride);
  e.shifted_p.resize(s);
  for (int j = 0; j < n; ++j) e.shifted_p[j] = e.p[e.shifted[j]];
  e.disparity_inputs.resize(static_cast<std::size_t>(rows) * s);
  e.disparity_linear.resize(s);
  if (record) {
    e.grid_taps.clear();
    grid_.lookup_record(e.shifted_p.data(), n, e.disparity_inputs.data(), stride, e.grid_taps);
  } else {
    grid_.lookup(e.shifted_p.data(), n, e.disparity_inputs.data(), stride);
  }
  if (config_.disparity_direction) {
    for (int j = 0; j < n; ++j)
      spherical_harmonics(e.w[e.shifted[j]], row(e.disparity_inputs, grid_rows, stride) + j, stride);
  }
  if (record) disparity_.forward(e.disparity_inputs.data(), n, stride, e.disparity_linear.data(), e.disparity_kept);
  else disparity_.forward(e.disparity_inputs.data(), n, stride, e.disparity_linear.data());
  for (int j = 0; j < n; ++j) e.disparity[e.shifted[j]] = squareplus(e.disparity_linear[j]).value * disparity_unit_;
}

// Fills e.inputs (features first, then the point's own inputs) for up to kQueryChunk points.
void OctaOctreeField::encode(std::span<const SurfacePoint> points, Encoded& e, bool record) const {
  const int n = static_cast<int>(points.size());
  const int stride = e.stride = padded(n);
  const auto s = static_cast<std::size_t>(stride);
  e.x.resize(s);
  e.p.resize(s);
  e.w.resize(s);
  e.disparity.assign(s, 0.0f);
  for (int i = 0; i < n; ++i) {
    e.x[i] = points[i].x;
    e.w[i] = lookup_direction(rule_, points[i]);
    e.p[i] = (points[i].x - origin_) / size_;
  }
  e.shifted.clear();
  if (offset_ != LookupOffset::none) {
    for (int i = 0; i < n; ++i)
      if (rule_.has_offset(points[i].alpha)) e.shifted.push_back(i);
  }
  if (offset_ == LookupOffset::predicted) predict_disparity(e, record);
  if (offset_ == LookupOffset::traced) {
    for (const int i : e.shifted) e.disparity[i] = points[i].disparity;
  }
  const int inputs = decoder_.mlp().shape().inputs;
  e.inputs.resize(static_cast<std::size_t>(inputs) * s);
  const std::int64_t empty =
      record ? octree_.lookup_record(e.x.data(), e.w.data(), e.disparity.data(), n, e.inputs.data(), stride, e.record)
             : octree_.lookup(e.x.data(), e.w.data(), e.disparity.data(), n, e.inputs.data(), stride);
  if (empty > 0) empty_lookups_.fetch_add(empty, std::memory_order_relaxed);
  if (reflects_) look_up_reflected(points, e, record);
  decoder_.fill_inputs(points, e.w.data(), e.inputs.data(), inputs - kPointInputs, stride);
}

// Fills the rows of e.inputs between the point's features and its own inputs.
void OctaOctreeField::look_up_reflected(std::span<const SurfacePoint> points, Encoded& e, bool record) const {
  const int features = octree_.feature_count(), attributes = 2 * features;
  std::fill(row(e.inputs, features, e.stride), row(e.inputs, attributes + kReflectedInputs, e.stride), 0.0f);
  e.reflected.clear();
  e.reflected_x.clear();
  e.reflected_w.clear();
  for (const int i : e.shifted) {
    const SurfacePoint& p = points[i];
    Vec3f position(0.0f);
    if (has_reflected(rule_, p, e.disparity[i])) {
      const Vec3f w = ray_direction(p.reflected, e.w[i]), x = reflected_position(p.x, w, e.disparity[i]);
      position = contract((x - origin_) / size_ * 2.0f - Vec3f(1.0f));
      e.reflected.push_back(i);
      e.reflected_x.push_back(x);
      e.reflected_w.push_back(reflected_direction(rule_, p.reflected, w));
    }
    float numbers[kReflectedInputs];
    reflected_inputs(rule_, p, e.disparity[i], position, target_scale(), numbers);
    for (int k = 0; k < kReflectedInputs; ++k) row(e.inputs, attributes + k, e.stride)[i] = numbers[k];
  }
  const int n = static_cast<int>(e.reflected.size()), stride = e.reflected_stride = padded(n);
  if (n == 0) return;
  e.reflected_x.resize(static_cast<std::size_t>(stride));
  e.reflected_w.resize(static_cast<std::size_t>(stride));
  e.reflected_d.assign(static_cast<std::size_t>(stride), 0.0f);
  e.reflected_features.resize(static_cast<std::size_t>(features) * static_cast<std::size_t>(stride));
  const Vec3f *x = e.reflected_x.data(), *w = e.reflected_w.data();
  float* out = e.reflected_features.data();
  if (record) octree_.lookup_record(x, w, e.reflected_d.data(), n, out, stride, e.reflected_record);
  else octree_.lookup(x, w, e.reflected_d.data(), n, out, stride);
  for (int f = 0; f < features; ++f) {
    const float* from = row(e.reflected_features, f, stride);
    float* to = row(e.inputs, features + f, e.stride);
    for (int j = 0; j < n; ++j) to[e.reflected[j]] = from[j];
  }
}

void OctaOctreeField::radiance(std::span<const SurfacePoint> points, std::span<Vec3f> out) const {
  thread_local Encoded e;
  for (std::size_t begin = 0; begin < points.size(); begin += kQueryChunk) {
    const auto chunk = points.subspan(begin, std::min<std::size_t>(kQueryChunk, points.size() - begin));
    encode(chunk, e, false);
    e.linear.resize(3 * static_cast<std::size_t>(e.stride));
    decoder_.mlp().forward(e.inputs.data(), static_cast<int>(chunk.size()), e.stride, e.linear.data());
    decoder_.activate(chunk, e.linear.data(), e.stride, out.data() + begin);
  }
}

void OctaOctreeField::inspect(std::span<const SurfacePoint> points, std::span<float> features,
                              std::span<float> disparity) const {
  Encoded e;
  const auto count = static_cast<std::size_t>(feature_count());
  for (std::size_t begin = 0; begin < points.size(); begin += kQueryChunk) {
    const auto chunk = points.subspan(begin, std::min<std::size_t>(kQueryChunk, points.size() - begin));
    encode(chunk, e, false);
    if (!features.empty()) copy_features(e.inputs, e.stride, chunk.size(), count, features.data() + begin * count);
    if (!disparity.empty()) std::copy_n(e.disparity.begin(), chunk.size(), disparity.data() + begin);
  }
}

// Forward and backward of one chunk; `first` is its first point within the batch.
double OctaOctreeField::backward(std::span<const SurfacePoint> points, std::span<const Vec3f> targets,
                                 std::size_t first, std::size_t batch, double epsilon, Encoded& e,
                                 Gradients& gradients) {
  encode(points, e, true);
  const int n = static_cast<int>(points.size()), stride = e.stride;
  const int features = octree_.feature_count(), levels = octree_.options().levels, width = octree_.options().features;
  const auto s = static_cast<std::size_t>(stride);
  e.linear.resize(3 * s);
  e.d_linear.resize(3 * s);
  e.d_inputs.resize(e.inputs.size());
  decoder_.mlp().forward(e.inputs.data(), n, stride, e.linear.data(), e.decoder_kept);
  const double loss =
      decoder_.loss(points, targets, e.linear.data(), stride, batch, epsilon, e.d_linear.data(), gradients.non_finite);
  decoder_.mlp().backward(e.inputs.data(), e.d_linear.data(), e.decoder_kept, gradients.decoder, e.d_inputs.data());

  // The part of the table's gradient of one look-up: `record`'s query j, with the gradient at its features in rows
  // `from` of point i. `place`: of the look-up among those of the batch.
  const auto add_taps = [&](const OctaOctree::Record& record, std::size_t j, std::size_t i, int from,
                            std::size_t place) {
    for (int l = 0; l < levels; ++l) {
      const auto source =
          static_cast<std::uint32_t>(place * static_cast<std::size_t>(levels) + static_cast<std::size_t>(l));
      float* upstream = octree_upstream_.data() + static_cast<std::size_t>(source) * static_cast<std::size_t>(width);
      for (int c = 0; c < width; ++c) upstream[c] = row(e.d_inputs, from + l * width + c, stride)[i];
      const std::uint32_t* begin =
          record.begin.data() + j * static_cast<std::size_t>(levels + 1) + static_cast<std::size_t>(l);
      for (std::uint32_t t = begin[0]; t < begin[1]; ++t)
        gradients.octree.push_back({record.taps[t].entry, source, record.taps[t].weight});
    }
  };
  for (std::size_t i = 0; i < points.size(); ++i) add_taps(e.record, i, i, 0, first + i);
  for (std::size_t j = 0; reflects_ && j < e.reflected.size(); ++j) {
    const auto i = static_cast<std::size_t>(e.reflected[j]);
    add_taps(e.reflected_record, j, i, features, batch + first + i);
  }
  if (offset_ != LookupOffset::predicted || e.shifted.empty()) return loss;

  e.d_disparity_linear.assign(static_cast<std::size_t>(e.shifted_stride), 0.0f);
  for (int f = 0; f < features; ++f) {
    const float* upstream = row(e.d_inputs, f, stride);
    const float* derivative = row(e.record.derivative, f, stride);
    for (std::size_t j = 0; j < e.shifted.size(); ++j)
      e.d_disparity_linear[j] += upstream[e.shifted[j]] * derivative[e.shifted[j]];
  }
  for (std::size_t j = 0; j < e.shifted.size(); ++j)
    e.d_disparity_linear[j] *= squareplus(e.disparity_linear[j]).derivative * disparity_unit_;
  e.d_disparity_inputs.resize(e.disparity_inputs.size());
  disparity_.backward(e.disparity_inputs.data(), e.d_disparity_linear.data(), e.disparity_kept, gradients.disparity,
                      e.d_disparity_inputs.data());
  add_grid_taps(grid_, e.grid_taps, e.d_disparity_inputs, e.shifted_stride, e.shifted.size(), first, grid_upstream_,
                gradients.grid);
  return loss;
}

void OctaOctreeField::make_optimizers() {
  if (octree_adam_) return;
  octree_adam_ = make_table_adam(octree_.entry_count(), octree_.options().features, config_);
  grid_adam_ = make_table_adam(grid_.entry_count(), grid_.options().features, config_);
}

FieldStep OctaOctreeField::train(std::span<const SurfacePoint> points, std::span<const Vec3f> targets, double epsilon,
                                 RateScale scale) {
  make_optimizers();
  const std::size_t n = points.size();
  octree_upstream_.resize((reflects_ ? 2 : 1) * n * static_cast<std::size_t>(feature_count()));
  grid_upstream_.resize(n * static_cast<std::size_t>(grid_.feature_count()));
  const GroupedBatch groups(n);
  std::vector<Gradients> gradients(groups.count());
  parallel_for(groups.count(), [&](std::size_t g) {
    thread_local Encoded e;
    Gradients& mine = gradients[g];
    mine.decoder.assign(decoder_.mlp().parameter_count(), 0.0f);
    mine.disparity.assign(disparity_.parameter_count(), 0.0f);
    for (std::size_t begin = groups.begin(g); begin < groups.end(g); begin += kQueryChunk) {
      const std::size_t count = std::min<std::size_t>(kQueryChunk, groups.end(g) - begin);
      mine.loss += backward(points.subspan(begin, count), targets.subspan(begin, count), begin, n, epsilon, e, mine);
    }
  });

  FieldStep step;
  std::vector<std::span<const float>> decoder, disparity;
  std::vector<std::span<const SparseTap>> octree, grid;
  for (const Gradients& g : gradients) {
    decoder.push_back(g.decoder);
    disparity.push_back(g.disparity);
    octree.push_back(g.octree);
    grid.push_back(g.grid);
    step.loss += g.loss / (3.0 * static_cast<double>(n));
    step.non_finite += g.non_finite;
  }
  step.non_finite += step_mlp(decoder_.mlp(), decoder_.adam(), decoder, config_.adam_rate_networks * scale.networks);
  const auto sparse =
      octree_adam_->step(octree_.features(), octree, octree_upstream_, config_.adam_rate_features * scale.tables);
  step.touched = sparse.touched;
  step.non_finite += sparse.non_finite;
  if (offset_ == LookupOffset::predicted) {
    step.non_finite += step_mlp(disparity_, disparity_adam_, disparity, config_.adam_rate_networks * scale.networks);
    step.non_finite +=
        grid_adam_->step(grid_.table(), grid, grid_upstream_, config_.adam_rate_grids * scale.tables).non_finite;
  }
  return step;
}

std::vector<long long> OctaOctreeField::cells_per_level() const {
  std::vector<long long> counts;
  for (int level = 1; level <= levels(); ++level) counts.push_back(static_cast<long long>(octree_.cells(level).size()));
  return counts;
}

std::vector<WeightArray> OctaOctreeField::weights() {
  return {{"octree.features", octree_.features()},
          {"disparity.grid.table", grid_.table()},
          {"disparity.mlp", disparity_.weights()},
          {"decoder.mlp", decoder_.mlp().weights()}};
}

void OctaOctreeField::weights_changed() {
  disparity_.prepare();
  decoder_.mlp().prepare();
}

void OctaOctreeField::save(TensorWriter& out) {
  const int width = octree_.options().features;
  octree_.canonicalize_rims();
  for (int l = 1; l <= levels(); ++l) {
    const std::string prefix = "octree.level" + std::to_string(l);
    const auto& cells = octree_.cells(l);
    const auto count = static_cast<std::int64_t>(cells.size());
    const std::int64_t r = octree_.map_resolution(l) + 1;
    static_assert(sizeof(Vec3i) == 3 * sizeof(std::int32_t));
    out.add(prefix + ".cells", DType::i32, {count, 3}, cells.data());
    out.add(prefix + ".features", DType::f32, {count, r * r, width},
            octree_.features().data() + octree_.level_offset(l) * width);
  }
  out.add("octree.origin", DType::f32, {3}, &origin_);
  out.add("octree.size", DType::f32, {3}, &size_);
  save_hash_grid(out, "disparity.grid", grid_);
  save_mlp(out, "disparity.mlp", disparity_);
  save_mlp(out, "decoder.mlp", decoder_.mlp());
}

void OctaOctreeField::save_optimizer(TensorWriter& out) {
  make_optimizers();  // a run stopped before its first step can be resumed too
  save_adam(out, "disparity.mlp", disparity_adam_);
  save_adam(out, "decoder.mlp", decoder_.adam());
  save_adam(out, "octree", *octree_adam_, octree_.entry_count(), octree_.options().features);
  save_adam(out, "disparity.grid", *grid_adam_, grid_.entry_count(), grid_.options().features);
}

void OctaOctreeField::load(const TensorReader& in) {
  const int width = octree_.options().features;
  for (int l = 1; l <= levels(); ++l) {
    const std::string name = "octree.level" + std::to_string(l) + ".features";
    const std::int64_t r = octree_.map_resolution(l) + 1;
    read_floats(in, name, {static_cast<std::int64_t>(octree_.cells(l).size()), r * r, width},
                octree_.features().subspan(static_cast<std::size_t>(octree_.level_offset(l) * width)));
  }
  load_hash_grid(in, "disparity.grid", grid_);
  load_mlp(in, "disparity.mlp", disparity_);
  load_mlp(in, "decoder.mlp", decoder_.mlp());
}

void OctaOctreeField::load_optimizer(const TensorReader& in) {
  make_optimizers();
  load_adam(in, "disparity.mlp", disparity_adam_);
  load_adam(in, "decoder.mlp", decoder_.adam());
  load_adam(in, "octree", *octree_adam_, octree_.entry_count(), octree_.options().features);
  load_adam(in, "disparity.grid", *grid_adam_, grid_.entry_count(), grid_.options().features);
}

}  // namespace octrad
