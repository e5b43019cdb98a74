#include "octrad/model/octaoctree_field.h"

#include <algorithm>
#include <numeric>

#include "octrad/encoding/spherical_harmonics_math.h"
#include "octrad/model/field_storage.h"
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
  const bool predicts = config.lookup_offset == LookupOffset::predicted;
  if (predicts)
    add_table_memory(parts, "disparity grid", static_cast<double>(hash_grid_entries(disparity_grid_options(config))),
                     config.disparity_features, config, training);
  const bool averages = training && config.train_average > 0.0;  // have an octree of their own
  parts.push_back({"octree cells and index", static_cast<std::uint64_t>(cells * (averages ? 56.0 : 28.0))});
  // About 40 of the 64 cells of a query hold surfaces.
  const double lookups = looks_up_reflected(config) ? 2.0 : 1.0;
  if (training)
    add_batch_memory(parts, config,
                     lookups * (config.octree_levels * 24.0 + config.octree_fine * 8.0) * 0.65 +
                         (predicts ? config.disparity_levels * 8.0 : 0.0));
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
  DecoderRows rows;
  std::vector<Vec3f> x, p, w;
  std::vector<int> shifted;  // points that have an offset; disparity_* and grid_taps are of these
  int shifted_stride = 0;
  std::vector<Vec3f> shifted_p;
  std::vector<float> disparity, disparity_inputs, disparity_linear, d_disparity_linear, d_disparity_inputs;
  OctaOctree::Record record;
  // Look-ups at reflected surfaces, of the points `reflected`.
  std::vector<int> reflected;
  int reflected_stride = 0;
  std::vector<Vec3f> reflected_x, reflected_w;
  std::vector<float> reflected_d, reflected_features;
  OctaOctree::Record reflected_record;
  std::vector<Tap> grid_taps;
  Mlp::Workspace disparity_kept;
};

DisparityPredictor::DisparityPredictor(const Config& config)
    : grid(disparity_grid_options(config)),
      network(disparity_shape(config)) {
  const auto seed = static_cast<unsigned long long>(config.seed);
  network.initialize(seed, kDisparityNetworkWeights);
  initialize_hash_grid(grid, seed, kDisparityGridWeights);
}

OctaOctreeField::OctaOctreeField(const Config& config, const FieldDomain& domain)
    : FieldBase(config, domain, "decoder.mlp", decoder_shape(config), config.decoder_output, kDecoderWeights),
      rule_(octrad::lookup_rule(config)),
      offset_(config.lookup_offset),
      disparity_unit_(config.disparity_unit == DisparityUnit::extent ? 1.0f / max_component(domain.size) : 1.0f),
      octree_(octree_options(config), domain.occupied_cells, domain.origin, domain.size),
      reflects_(looks_up_reflected(config)) {
  if (offset_ == LookupOffset::predicted) {
    predictor_ = std::make_unique<DisparityPredictor>(config);
    add_network("disparity.mlp", predictor_->network);
  }
  FieldTable& octree = add_table("octree", octree_.features(), octree_.options().features, config.adam_rate_features,
                                 static_cast<std::size_t>(reflects_ ? 2 * levels() : levels()));
  octree.weights_name = "octree.features";
  octree.save = [this](TensorWriter& out) { save_octree(out); };
  octree.load = [this](const TensorReader& in) { load_octree(in); };
  if (predictor_)
    add_grid("disparity.grid", predictor_->grid, static_cast<std::size_t>(predictor_->grid.options().levels));
}

// Fills e.disparity of the points e.shifted, for which alone the predictor is asked.
void OctaOctreeField::predict_disparity(Encoded& e, bool record) const {
  const int n = static_cast<int>(e.shifted.size()), stride = e.shifted_stride = padded(n);
  if (n == 0) return;
  const HashGrid& grid = predictor_->grid;
  const Mlp& network = predictor_->network;
  const int grid_rows = grid.feature_count(), rows = network.shape().inputs;
  const auto s = static_cast<std::size_t>(stride);
  e.shifted_p.resize(s);
  for (int j = 0; j < n; ++j) e.shifted_p[j] = e.p[e.shifted[j]];
  e.disparity_inputs.resize(static_cast<std::size_t>(rows) * s);
  e.disparity_linear.resize(s);
  if (record) grid.lookup_record(e.shifted_p.data(), n, e.disparity_inputs.data(), stride, e.grid_taps);
  else grid.lookup(e.shifted_p.data(), n, e.disparity_inputs.data(), stride);
  if (config_.disparity_direction) {
    for (int j = 0; j < n; ++j)
      spherical_harmonics(e.w[e.shifted[j]], row(e.disparity_inputs, grid_rows, stride) + j, stride);
  }
  if (record) network.forward(e.disparity_inputs.data(), n, stride, e.disparity_linear.data(), e.disparity_kept);
  else network.forward(e.disparity_inputs.data(), n, stride, e.disparity_linear.data());
  for (int j = 0; j < n; ++j) e.disparity[e.shifted[j]] = squareplus(e.disparity_linear[j]).value * disparity_unit_;
}

// Fills e.rows.inputs (features first, then the point's own inputs) for up to kQueryChunk points.
void OctaOctreeField::encode(std::span<const SurfacePoint> points, Encoded& e, bool record) const {
  const int n = static_cast<int>(points.size());
  const int stride = e.rows.stride = padded(n);
  const auto s = static_cast<std::size_t>(stride);
  e.x.resize(s);
  e.p.resize(s);
  e.w.resize(s);
  e.disparity.assign(s, 0.0f);
  for (int i = 0; i < n; ++i) {
    e.x[i] = points[i].x;
    e.w[i] = lookup_direction(rule_, points[i]);
    e.p[i] = normalized(points[i].x);
  }
  e.shifted.clear();
  if (offset_ != LookupOffset::none) {
    for (int i = 0; i < n; ++i)
      if (rule_.has_offset(points[i].alpha)) e.shifted.push_back(i);
  }
  if (predictor_) predict_disparity(e, record);
  if (offset_ == LookupOffset::traced) {
    for (const int i : e.shifted) e.disparity[i] = points[i].disparity;
  }
  const int inputs = decoder_.mlp().shape().inputs;
  e.rows.inputs.resize(static_cast<std::size_t>(inputs) * s);
  float* out = e.rows.inputs.data();
  const std::int64_t empty =
      record ? octree_.lookup_record(e.x.data(), e.w.data(), e.disparity.data(), n, out, stride, e.record)
             : octree_.lookup(e.x.data(), e.w.data(), e.disparity.data(), n, out, stride);
  if (empty > 0) empty_lookups_.fetch_add(empty, std::memory_order_relaxed);
  if (reflects_) look_up_reflected(points, e, record);
  decoder_.fill_inputs(points, e.w.data(), out, inputs - kPointInputs, stride);
}

// Fills the rows of e.rows.inputs between the point's features and its own inputs.
void OctaOctreeField::look_up_reflected(std::span<const SurfacePoint> points, Encoded& e, bool record) const {
  const int features = octree_.feature_count(), attributes = 2 * features;
  std::vector<float>& inputs = e.rows.inputs;
  const int row_stride = e.rows.stride;
  std::fill(row(inputs, features, row_stride), row(inputs, attributes + kReflectedInputs, row_stride), 0.0f);
  e.reflected.clear();
  e.reflected_x.clear();
  e.reflected_w.clear();
  for (const int i : e.shifted) {
    const SurfacePoint& p = points[i];
    Vec3f position(0.0f);
    if (has_reflected(rule_, p, e.disparity[i])) {
      const Vec3f w = ray_direction(p.reflected, e.w[i]), x = reflected_position(p.x, w, e.disparity[i]);
      position = contract(normalized(x) * 2.0f - Vec3f(1.0f));
      e.reflected.push_back(i);
      e.reflected_x.push_back(x);
      e.reflected_w.push_back(reflected_direction(rule_, p.reflected, w));
    }
    float numbers[kReflectedInputs];
    reflected_inputs(rule_, p, e.disparity[i], position, target_scale(), numbers);
    for (int k = 0; k < kReflectedInputs; ++k) row(inputs, attributes + k, row_stride)[i] = numbers[k];
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
    float* to = row(inputs, features + f, row_stride);
    for (int j = 0; j < n; ++j) to[e.reflected[j]] = from[j];
  }
}

void OctaOctreeField::radiance(std::span<const SurfacePoint> points, std::span<Vec3f> out) const {
  thread_local Encoded e;
  for_chunks(points, [&](std::span<const SurfacePoint> chunk, std::size_t first) {
    encode(chunk, e, false);
    decode(chunk, e.rows, out.data() + first);
  });
}

void OctaOctreeField::inspect(std::span<const SurfacePoint> points, std::span<float> features,
                              std::span<float> disparity) const {
  Encoded e;
  for_chunks(points, [&](std::span<const SurfacePoint> chunk, std::size_t first) {
    encode(chunk, e, false);
    if (!features.empty()) copy_features(e.rows, first, chunk.size(), features);
    if (!disparity.empty()) std::copy_n(e.disparity.data(), chunk.size(), disparity.data() + first);
  });
}

void OctaOctreeField::differentiate(std::span<const SurfacePoint> points, std::span<const Vec3f> targets,
                                    const BatchPart& part, Gradients& gradients) {
  thread_local Encoded kept;
  Encoded& e = kept;
  encode(points, e, true);
  differentiate_decoder(points, targets, part, e.rows, gradients);
  const int features = octree_.feature_count(), levels = octree_.options().levels, width = octree_.options().features;
  const int stride = e.rows.stride;
  std::vector<float>& d_inputs = e.rows.d_inputs;
  float* octree_upstream = upstream(kOctree).data();
  std::vector<SparseTap>& octree_taps = gradients.tables[kOctree];

  // The part of the table's gradient of one look-up: `record`'s query j, with the gradient at its features in rows
  // `from` of point i. `place`: of the look-up among those of the batch.
  const auto add_taps = [&](const OctaOctree::Record& record, std::size_t j, std::size_t i, int from,
                            std::size_t place) {
    for (int l = 0; l < levels; ++l) {
      const auto source =
          static_cast<std::uint32_t>(place * static_cast<std::size_t>(levels) + static_cast<std::size_t>(l));
      float* to = octree_upstream + static_cast<std::size_t>(source) * static_cast<std::size_t>(width);
      for (int c = 0; c < width; ++c) to[c] = row(d_inputs, from + l * width + c, stride)[i];
      const std::uint32_t* begin =
          record.begin.data() + j * static_cast<std::size_t>(levels + 1) + static_cast<std::size_t>(l);
      for (std::uint32_t t = begin[0]; t < begin[1]; ++t)
        octree_taps.push_back({record.taps[t].entry, source, record.taps[t].weight});
    }
  };
  for (std::size_t i = 0; i < points.size(); ++i) add_taps(e.record, i, i, 0, part.first + i);
  for (std::size_t j = 0; reflects_ && j < e.reflected.size(); ++j) {
    const auto i = static_cast<std::size_t>(e.reflected[j]);
    add_taps(e.reflected_record, j, i, features, part.batch + part.first + i);
  }
  if (!predictor_ || e.shifted.empty()) return;

  e.d_disparity_linear.assign(static_cast<std::size_t>(e.shifted_stride), 0.0f);
  for (int f = 0; f < features; ++f) {
    const float* d_feature = row(d_inputs, f, stride);
    const float* derivative = row(e.record.derivative, f, stride);
    for (std::size_t j = 0; j < e.shifted.size(); ++j)
      e.d_disparity_linear[j] += d_feature[e.shifted[j]] * derivative[e.shifted[j]];
  }
  for (std::size_t j = 0; j < e.shifted.size(); ++j)
    e.d_disparity_linear[j] *= squareplus(e.disparity_linear[j]).derivative * disparity_unit_;
  e.d_disparity_inputs.resize(e.disparity_inputs.size());
  predictor_->network.backward(e.disparity_inputs.data(), e.d_disparity_linear.data(), e.disparity_kept,
                               gradients.networks[kDisparity], e.d_disparity_inputs.data());
  add_grid_taps(predictor_->grid, e.grid_taps, e.d_disparity_inputs, e.shifted_stride, e.shifted.size(), part.first,
                upstream(kGrid), gradients.tables[kGrid]);
}

std::vector<long long> OctaOctreeField::cells_per_level() const {
  std::vector<long long> counts;
  for (int level = 1; level <= levels(); ++level) counts.push_back(static_cast<long long>(octree_.cells(level).size()));
  return counts;
}

void OctaOctreeField::save_octree(TensorWriter& out) {
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
}

void OctaOctreeField::load_octree(const TensorReader& in) {
  const int width = octree_.options().features;
  for (int l = 1; l <= levels(); ++l) {
    const std::string name = "octree.level" + std::to_string(l) + ".features";
    const std::int64_t r = octree_.map_resolution(l) + 1;
    read_floats(in, name, {static_cast<std::int64_t>(octree_.cells(l).size()), r * r, width},
                octree_.features().subspan(static_cast<std::size_t>(octree_.level_offset(l) * width)));
  }
}

}  // namespace octrad
