// The OctaOctree field on a device (method sections 4, 5 and 7).
#include <numeric>

#include "octrad/device/launch.h"
#include "octrad/encoding/spherical_harmonics_math.h"
#include "octrad/model/field_base_device.h"
#include "octrad/model/octaoctree_field.h"
#include "octrad/model/reflected_math.h"

namespace octrad {
namespace {

struct Harmonics : Kernel {
  const float* w;
  std::size_t stride;
  QueueSlice slice;
  HalfRows inputs;
  int first;

  OCTRAD_HD void operator()(std::uint32_t i) const {
    if (!slice.holds(i)) return;
    float values[kSphericalHarmonics];
    spherical_harmonics(Vec3f(w[i], w[stride + i], w[2 * stride + i]), values);
    OCTRAD_UNROLL
    for (int k = 0; k < kSphericalHarmonics; k += 2) inputs.store2(first + k, i, values[k], values[k + 1]);
  }
};

struct ToDisparity : Kernel {
  const float* linear;
  SurfacePointArray points;
  LookupRule rule;
  QueueSlice slice;
  float unit;
  float* disparity;

  OCTRAD_HD void operator()(std::uint32_t i) const {
    if (!slice.holds(i)) return;
    disparity[i] = rule.has_offset(points.get(kAlphaNumber, i)) ? squareplus(linear[i]).value * unit : 0.0f;
  }
};

struct TracedDisparity : Kernel {
  SurfacePointArray points;
  LookupRule rule;
  QueueSlice slice;
  const std::uint32_t* valid;  // training
  float* disparity;

  OCTRAD_HD void operator()(std::uint32_t i) const {
    if (!slice.holds(i)) return;
    const bool none = (valid != nullptr && valid[i] == 0) || !rule.has_offset(points.get(kAlphaNumber, i));
    disparity[i] = none ? 0.0f : points.get(kDisparityNumber, i);
  }
};

// Inputs of the decoder about what is reflected, and where its features are looked up: a position that is NaN where
// nothing is, whose features are 0 and get no gradient.
struct PrepareReflected : Kernel {
  SurfacePointArray points;
  LookupRule rule;
  QueueSlice slice;
  const std::uint32_t* valid;  // training
  const float* directions;     // w of the points
  const float* disparity;
  Vec3f scale, offset;   // to [-1, 1] of the domain
  const float* scalars;  // target_scale
  HalfRows inputs;
  int first;
  float *x, *w;  // of the look-ups
  std::size_t stride;

  OCTRAD_HD void operator()(std::uint32_t i) const {
    if (!slice.holds(i)) return;
    SurfacePoint p;
    p.alpha = points.get(kAlphaNumber, i);
    p.reflected = points.reflected.get(i);
    const ReflectedSurface& r = p.reflected;
    bool good = valid == nullptr || valid[i] != 0;
    good = good && is_finite(r.n) && is_finite(r.albedo) && is_finite(r.emitted) && std::isfinite(r.alpha) &&
           is_finite(r.w);
    if (!good) p.reflected = ReflectedSurface{};
    const Vec3f direction = ray_direction(r, {directions[i], directions[stride + i], directions[2 * stride + i]});
    const bool met = has_reflected(rule, p, disparity[i]);
    Vec3f at(std::nanf("")), seen_along(0.0f, 0.0f, 1.0f), position(0.0f);
    if (met) {
      at = reflected_position(points.get3(0, i), direction, disparity[i]);
      seen_along = reflected_direction(rule, r, direction);
      position = contract(at * scale + offset);
    }
    OCTRAD_UNROLL
    for (int c = 0; c < 3; ++c) {
      x[static_cast<std::size_t>(c) * stride + i] = at[c];
      w[static_cast<std::size_t>(c) * stride + i] = seen_along[c];
    }
    float numbers[kReflectedInputs];
    reflected_inputs(rule, p, disparity[i], position, scalars[0], numbers);
    OCTRAD_UNROLL
    for (int k = 0; k < kReflectedInputs; k += 2)
      inputs.store2(first + k, i, bounded_half(numbers[k]), bounded_half(numbers[k + 1]));
  }
};

// Gradient at the linear output from its parts by level.
struct DisparityGradient : Kernel {
  const float* parts;  // [levels][stride]
  std::size_t stride;
  int levels;
  const float* linear;
  SurfacePointArray points;
  LookupRule rule;
  float unit;
  float* d_linear;
  std::uint32_t* largest;
  unsigned long long* non_finite;

  OCTRAD_HD void operator()(std::uint32_t i) const {
    float sum = 0.0f;
    for (int l = 0; l < levels; ++l) sum += parts[static_cast<std::size_t>(l) * stride + i];
    sum *= rule.has_offset(points.get(kAlphaNumber, i)) ? squareplus(linear[i]).derivative * unit : 0.0f;
    if (!std::isfinite(sum)) {
      sum = 0.0f;
      atomic_add(non_finite, 1ull);
    }
    d_linear[i] = sum;
    atomic_max(largest, magnitude_bits(sum));
  }
};

// The counterpart of DisparityPredictor, and the rows of its network.
struct DevicePredictor {
  DevicePredictor(Stream& stream, DisparityPredictor& of, OctaOctree& octree, const DeviceTableOptions& table_options,
                  std::size_t rows, std::size_t train_rows)
      : grid(of.grid, octree.origin(), octree.size()),
        table(stream, static_cast<std::size_t>(of.grid.entry_count()), of.grid.options().features, table_options,
              "disparity grid"),
        network(stream, of.network.shape(), train_rows, "disparity network"),
        inputs(stream, static_cast<std::size_t>(of.network.shape().inputs + 1) / 2 * rows, "queries in flight"),
        linear(stream, rows, "queries in flight") {}

  DeviceHashGrid grid;
  DeviceTable table;
  DeviceMlp network;
  DeviceArray<std::uint32_t> inputs;
  DeviceArray<float> linear;
  DeviceArray<float> parts, d_inputs, d_linear, scale;  // when training; parts: gradients by level of the octree
};

// A step may look up twice for each of its points.
DeviceTableOptions octree_table_options(const Config& config, const DeviceFieldOptions& options) {
  DeviceTableOptions table = DeviceFieldBase::table_options(config, options, octree_levels(config), kOctreeTaps);
  if (looks_up_reflected(config)) table.touches *= 2;
  return table;
}

class DeviceOctaOctreeField : public DeviceFieldBase {
 public:
  DeviceOctaOctreeField(Stream& stream, OctaOctreeField& field, const Config& config, const DeviceFieldOptions& options)
      : DeviceFieldBase(stream, field, config, options),
        offset_(field.offset()),
        rule_(field.lookup_rule()),
        unit_(field.disparity_unit()),
        octree_(stream, field.octree()),
        table_(stream, static_cast<std::size_t>(field.octree().entry_count()), field.octree().options().features,
               octree_table_options(config, options), "octree features"),
        distance_(stream, rows_, "queries in flight"),
        empty_(stream, 1, "queries in flight") {
    if (looks_up_reflected(config)) {
      reflected_x_ = DeviceArray<float>(stream, 3 * rows_, "queries in flight");
      reflected_w_ = DeviceArray<float>(stream, 3 * rows_, "queries in flight");
    }
    distance_.fill(0);
    empty_.fill(0);
    if (DisparityPredictor* of = field.predictor()) {
      predictor_ = std::make_unique<DevicePredictor>(
          stream, *of, field.octree(), table_options(config, options, of->grid.options().levels, kHashGridTaps), rows_,
          train_rows(options));
      holds(field, {&predictor_->network}, {&table_, &predictor_->table});
      if (trains()) {
        const auto rows = [&](int count) {
          return DeviceArray<float>(stream, static_cast<std::size_t>(count) * train_rows_, "training points in flight");
        };
        predictor_->parts = rows(field.levels());
        predictor_->d_inputs = rows(of->grid.feature_count());
        predictor_->d_linear = rows(1);
        predictor_->scale = DeviceArray<float>(stream, 2, "training points in flight");
      }
    } else {
      holds(field, {}, {&table_});
    }
    upload_from(field);
  }

  long long take_empty_lookups() override {
    const auto count = static_cast<long long>(empty_.download()[0]);
    if (count > 0) empty_.fill(0);
    return count;
  }

 protected:
  LookupRule rule() const override { return rule_; }
  const float* disparities() const override { return distance_.data(); }

  void encode(const Chunk& chunk) override {
    if (predictor_) {
      DevicePredictor& p = *predictor_;
      const HalfRows inputs{p.inputs.data(), rows_};
      p.grid.lookup(stream_, read(p.table), queries(chunk), inputs, 0);
      if (config_.disparity_direction) {
        launch(stream_, chunk.n, Harmonics{{}, w_.data(), rows_, chunk.slice, inputs, p.grid.feature_count()});
      }
      const FloatRows linear{p.linear.data(), rows_};
      if (chunk.training) p.network.forward_keep(stream_, inputs, linear, chunk.n);
      else p.network.forward(stream_, inputs, linear, chunk.n, chunk.slice);
      launch(stream_, chunk.n,
             ToDisparity{{}, p.linear.data(), chunk.points, rule_, chunk.slice, unit_, distance_.data()});
    } else if (offset_ == LookupOffset::traced) {
      launch(stream_, chunk.n,
             TracedDisparity{
                 {}, chunk.points, rule_, chunk.slice, chunk.training ? valid_.data() : nullptr, distance_.data()});
    }
    if (!chunk.training) stream_.mark("disparity");
    DeviceQueries q = with_disparity(chunk);
    q.empty = empty_.data();
    const HalfRows inputs{inputs_.data(), rows_};
    octree_.lookup(stream_, read(table_), q, inputs, 0);
    if (reflected_x_.empty()) return;
    const int features = octree_.feature_count();
    launch(stream_, chunk.n,
           PrepareReflected{{},
                            chunk.points,
                            rule_,
                            chunk.slice,
                            chunk.training ? valid_.data() : nullptr,
                            w_.data(),
                            distance_.data(),
                            rules_.position_scale,
                            rules_.position_offset,
                            scalars_.data(),
                            inputs,
                            2 * features,
                            reflected_x_.data(),
                            reflected_w_.data(),
                            rows_});
    octree_.lookup(stream_, read(table_), reflected_queries(chunk), inputs, features);
  }

  void encode_backward(const Chunk& chunk, bool first) override {
    scatter(
        table_,
        [&](const auto& sink) {
          octree_.scatter(stream_, read(table_), with_disparity(chunk), d_inputs_.data(), train_rows_,
                          predictor_ ? predictor_->parts.data() : nullptr, train_rows_, sink);
        },
        kOctreeTaps, chunk.n, octree_.view().levels, d_inputs_.data(), train_rows_);
    if (!reflected_x_.empty()) {
      const float* upstream = d_inputs_.data() + static_cast<std::size_t>(octree_.feature_count()) * train_rows_;
      scatter(
          table_,
          [&](const auto& sink) {
            octree_.scatter(stream_, read(table_), reflected_queries(chunk), upstream, train_rows_, nullptr,
                            train_rows_, sink);
          },
          kOctreeTaps, chunk.n, octree_.view().levels, upstream, train_rows_);
    }
    if (!predictor_) return;
    DevicePredictor& p = *predictor_;
    launch(stream_, chunk.n,
           DisparityGradient{{},
                             p.parts.data(),
                             train_rows_,
                             octree_.view().levels,
                             p.linear.data(),
                             chunk.points,
                             rule_,
                             unit_,
                             p.d_linear.data(),
                             largest_.data(),
                             &counters_.data()->non_finite});
    choose_scale(p.scale.data());
    p.network.backward(stream_, {p.inputs.data(), rows_}, {p.d_linear.data(), train_rows_}, p.scale.data(),
                       {p.d_inputs.data(), train_rows_}, p.grid.feature_count(), chunk.n, !first);
    DeviceQueries shifted = queries(chunk);
    if (!rule_.rough_offset) {  // rough points touch nothing of the predictor
      shifted.alpha = chunk.points.data + kAlphaNumber * chunk.points.stride;
      shifted.alpha_below = rule_.rough_threshold;
    }
    scatter(
        p.table, [&](const auto& sink) { p.grid.scatter(stream_, shifted, p.d_inputs.data(), train_rows_, sink); },
        kHashGridTaps, chunk.n, p.grid.levels(), p.d_inputs.data(), train_rows_);
  }

  void features(const Chunk& chunk, FloatRows out) override {
    octree_.lookup(stream_, read(table_), with_disparity(chunk), out, 0);
  }

 private:
  DeviceQueries with_disparity(const Chunk& chunk) const {
    DeviceQueries q = queries(chunk);
    q.d = distance_.data();
    return q;
  }
  DeviceQueries reflected_queries(const Chunk& chunk) const {
    DeviceQueries q = queries(chunk);
    q.x = reflected_x_.data();
    q.w = reflected_w_.data();
    q.x_stride = q.w_stride = rows_;
    return q;
  }

  LookupOffset offset_;
  LookupRule rule_;
  float unit_;
  DeviceOctree octree_;
  DeviceTable table_;
  std::unique_ptr<DevicePredictor> predictor_;  // null with other offsets
  DeviceArray<float> distance_;
  DeviceArray<float> reflected_x_, reflected_w_;  // where and along what features of reflected surfaces are looked up
  DeviceArray<unsigned long long> empty_;
};

}  // namespace

std::unique_ptr<DeviceField> make_device_octaoctree(Stream& stream, RadianceField& field, const Config& config,
                                                    const DeviceFieldOptions& options) {
  return std::make_unique<DeviceOctaOctreeField>(stream, dynamic_cast<OctaOctreeField&>(field), config, options);
}

std::vector<MemoryPart> device_octaoctree_memory(const Config& config, const std::vector<long long>& cells_per_level,
                                                 const DeviceFieldOptions& options) {
  using Base = DeviceFieldBase;
  std::vector<MemoryPart> parts = Base::decoder_memory(decoder_shape(config), options);
  const std::int64_t entries = octree_entries(config.octree_levels, cells_per_level);
  const long long cells = std::accumulate(cells_per_level.begin(), cells_per_level.end(), 0LL);
  append(parts, DeviceTable::memory(static_cast<std::size_t>(entries), config.octree_features,
                                    octree_table_options(config, options), "octree features"));
  parts.push_back({"octree index", static_cast<std::uint64_t>(cells) * 4 + (1u << 20)});
  parts.push_back({"disparities in flight", Base::rows(options) * 4});
  if (config.lookup_offset == LookupOffset::predicted) {
    append(parts, DeviceTable::memory(static_cast<std::size_t>(hash_grid_entries(disparity_grid_options(config))),
                                      config.disparity_features,
                                      Base::table_options(config, options, config.disparity_levels, kHashGridTaps),
                                      "disparity grid"));
    const MlpShape shape = disparity_shape(config);
    append(parts, Base::network_memory(shape, Base::train_rows(options), "disparity network"));
    parts.push_back({"disparity queries in flight",
                     Base::rows(options) * static_cast<std::size_t>((shape.inputs + 1) / 2 + 1) * 4});
    if (options.max_train_points > 0) {
      const int numbers = octree_levels(config) + config.disparity_levels * config.disparity_features + 1;
      parts.push_back(
          {"disparity training points in flight", Base::train_rows(options) * static_cast<std::size_t>(numbers) * 4});
    }
  }
  if (looks_up_reflected(config)) parts.push_back({"reflected queries in flight", Base::rows(options) * 6 * 4});
  return parts;
}

}  // namespace octrad
