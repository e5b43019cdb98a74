// Neural Cone Radiosity on a device (method section 9). Glossy points are looked at some at a time: item g of them has
// the cones g K + k, k = 0 .. K - 1, of which those of empty clusters are skipped. When training the items are all
// points of the chunk, in order, so that sums over them are the same every time; else the glossy points that are
// listed.
#include <array>

#include "octrad/device/launch.h"
#include "octrad/model/field_base_device.h"
#include "octrad/model/ncr_field.h"

namespace octrad {
namespace {

constexpr std::size_t kItems = std::size_t{1} << 17;  // glossy points in flight: their cones keep any device busy

struct ListGlossy : Kernel {
  SurfacePointArray points;
  QueueSlice slice;
  float rough_threshold;
  std::uint32_t* list;
  std::uint32_t* count;
  OCTRAD_HD void operator()(std::uint32_t i) const {
    if (slice.holds(i) && points.get(kAlphaNumber, i) < rough_threshold) list[atomic_append(count)] = i;
  }
};

struct CountCones : Kernel {
  const std::uint32_t* items;
  std::uint32_t* cones;
  std::uint32_t each;
  OCTRAD_HD void operator()(std::uint32_t) const { *cones = *items * each; }
};

// Which points items are, and which of those are glossy.
struct Items {
  SurfacePointArray points;
  const std::uint32_t* list;   // null: item g is point g
  const std::uint32_t* valid;  // of points; null: all
  QueueSlice slice;
  float rough_threshold;

  OCTRAD_HD bool holds(std::uint32_t g) const { return slice.holds(g); }
  OCTRAD_HD std::uint32_t point(std::uint32_t g) const { return list != nullptr ? list[g] : g; }
  OCTRAD_HD bool glossy(std::uint32_t i) const {
    return (valid == nullptr || valid[i] != 0) && points.get(kAlphaNumber, i) < rough_threshold;
  }
};

OCTRAD_HD inline Vec3f three(FloatRows rows, std::size_t i) {
  return {rows.data[i], rows.data[rows.stride + i], rows.data[2 * rows.stride + i]};
}
OCTRAD_HD inline void set_three(FloatRows rows, std::size_t i, Vec3f v) {
  rows.data[i] = v.x;
  rows.data[rows.stride + i] = v.y;
  rows.data[2 * rows.stride + i] = v.z;
}

// Where cones end: positions and footprints of their look-ups, and what their network is given beside the features.
struct Cones : Kernel {
  Items items;
  std::uint32_t each;  // K
  DecoderRules rules;
  const LobeTable* lobe;
  Vec3f origin;
  float extent;
  FloatRows w;  // of points
  int features;
  FloatRows p;
  float* r;
  HalfRows inputs;

  OCTRAD_HD void operator()(std::uint32_t row) const {
    const std::uint32_t g = row / each, k = row - g * each;
    if (!items.holds(g)) return;
    const std::uint32_t i = items.point(g);
    HitCluster cluster;
    if (items.glossy(i)) cluster = items.points.lobe.get(static_cast<int>(k), i);
    if (!(cluster.share > 0.0f)) {
      r[row] = -1.0f;
      for (int f = 0; f <= kConePointInputs; f += 2) inputs.store2(features + f, row, 0.0f, 0.0f);
      return;
    }
    const SurfacePoint point = items.points.load(i);
    const Vec3f mirror = three(w, i);
    const ConeEnd end = cone_end(point, mirror, cluster, (*lobe)(point.alpha));
    const Vec3f x = rules.position(end.x), unit = (end.x - origin) / extent;
    const float footprint = end.r / extent;
    set_three(p, row, unit);
    r[row] = footprint;
    inputs.store2(features, row, bounded_half(x.x), bounded_half(x.y));
    inputs.store2(features + 2, row, bounded_half(x.z), -mirror.x);
    inputs.store2(features + 4, row, -mirror.y, -mirror.z);
    inputs.store2(features + 6, row, bounded_half(footprint), 1.0f);  // 1: for MlpInputMap
  }
};

struct MergeInputs : Kernel {
  Items items;
  std::uint32_t each;
  Activation activation;
  FloatRows linear;  // of the diffuse branch, by point
  FloatRows cone_linear;
  HalfRows inputs;
  FloatRows slope;  // training: receives the derivatives of the diffuse branch's activation

  OCTRAD_HD void operator()(std::uint32_t g) const {
    if (!items.holds(g)) return;
    const std::uint32_t i = items.point(g);
    float numbers[kMergeInputs] = {};
    if (items.glossy(i)) {
      const Vec3f diffuse = three(linear, i), albedo = items.points.get3(9, i);
      Vec3f derivative, sum;
      OCTRAD_UNROLL
      for (int c = 0; c < 3; ++c) {
        const Activated<float> output = activate(activation, diffuse[c]);
        numbers[c] = output.value;
        derivative[c] = output.derivative;
      }
      for (std::uint32_t k = 0; k < each; ++k) {
        const float share = items.points.lobe.get(static_cast<int>(k), i).share;
        if (!(share > 0.0f)) continue;
        const Vec3f cone = three(cone_linear, g * each + k);
        OCTRAD_UNROLL
        for (int c = 0; c < 3; ++c) sum[c] += share * activate(activation, cone[c]).value;
      }
      OCTRAD_UNROLL
      for (int c = 0; c < 3; ++c) {
        numbers[3 + c] = sum[c];
        numbers[7 + c] = albedo[c];
      }
      numbers[6] = items.points.get(kAlphaNumber, i);
      if (slope.data != nullptr) set_three(slope, g, derivative);
    }
    OCTRAD_UNROLL
    for (int f = 0; f < kMergeInputs; f += 2)
      inputs.store2(f, g, bounded_half(numbers[f]), bounded_half(numbers[f + 1]));
  }
};

struct Merged : Kernel {
  Items items;
  FloatRows merge_linear, linear;
  OCTRAD_HD void operator()(std::uint32_t g) const {
    if (!items.holds(g)) return;
    const std::uint32_t i = items.point(g);
    if (items.glossy(i)) set_three(linear, i, three(merge_linear, g));
  }
};

// The way back, item g being point g. largest: of the gradients at what a network gives.
struct ToMerge : Kernel {
  Items items;
  FloatRows d_linear, d_merge_linear;
  std::uint32_t* largest;
  OCTRAD_HD void operator()(std::uint32_t g) const {
    const Vec3f d = items.glossy(g) ? three(d_linear, g) : Vec3f(0.0f);
    set_three(d_merge_linear, g, d);
    atomic_max(largest, magnitude_bits(d));
  }
};

struct ToBranches : Kernel {
  Items items;
  std::uint32_t each;
  Activation activation;
  FloatRows d_merge_inputs, slope, cone_linear;
  FloatRows d_linear, d_cone_linear;
  std::uint32_t* largest;  // of d_linear and of d_cone_linear
  unsigned long long* non_finite;

  // 0 for what is not finite, which is counted.
  OCTRAD_HD static Vec3f kept(Vec3f v, unsigned long long& dropped) {
    OCTRAD_UNROLL
    for (int c = 0; c < 3; ++c) {
      if (std::isfinite(v[c])) continue;
      v[c] = 0.0f;
      ++dropped;
    }
    return v;
  }
  OCTRAD_HD void operator()(std::uint32_t g) const {
    const bool glossy = items.glossy(g);
    unsigned long long dropped = 0;
    const FloatRows d_glossy{d_merge_inputs.data + 3 * d_merge_inputs.stride, d_merge_inputs.stride};
    if (glossy) set_three(d_linear, g, kept(three(d_merge_inputs, g) * three(slope, g), dropped));
    std::uint32_t most = 0;
    for (std::uint32_t k = 0; k < each; ++k) {
      Vec3f d(0.0f);
      const float share = glossy ? items.points.lobe.get(static_cast<int>(k), g).share : 0.0f;
      if (share > 0.0f) {
        const Vec3f cone = three(cone_linear, g * each + k), up = three(d_glossy, g);
        OCTRAD_UNROLL
        for (int c = 0; c < 3; ++c) d[c] = up[c] * share * activate(activation, cone[c]).derivative;
        d = kept(d, dropped);
      }
      set_three(d_cone_linear, g * each + k, d);
      const std::uint32_t bits = magnitude_bits(d);
      most = bits > most ? bits : most;
    }
    atomic_max(largest, magnitude_bits(three(d_linear, g)));
    atomic_max(largest + 1, most);
    if (dropped > 0) atomic_add(non_finite, dropped);
  }
};

std::size_t items_of(const DeviceFieldOptions& options) {
  return std::max(DeviceFieldBase::train_rows(options), std::min(options.max_points, kItems));
}

// Words or floats that the constructor below takes for each of its arrays' items.
struct Sizes {
  std::size_t each, cone_pairs, merge_pairs = (kMergeInputs + 1) / 2, features;
  explicit Sizes(const Config& config)
      : each(static_cast<std::size_t>(config.ncr_clusters)),
        cone_pairs(static_cast<std::size_t>(config.ncr_cone_features + kConePointInputs + 1) / 2),
        features(static_cast<std::size_t>(config.ncr_cone_features)) {}
};

class DeviceNcrField : public DeviceFieldBase {
 public:
  DeviceNcrField(Stream& stream, NcrField& field, const Config& config, const DeviceFieldOptions& options)
      : DeviceFieldBase(stream, field, config, options),
        sizes_(config),
        each_(static_cast<std::uint32_t>(config.ncr_clusters)),
        origin_(field.origin()),
        extent_(field.extent()),
        grid_(field.grid(), field.origin(), field.size()),
        cone_grid_(field.cone_grid()),
        table_(stream, static_cast<std::size_t>(field.grid().entry_count()), field.grid().options().features,
               table_options(config, options, field.levels(), kHashGridTaps), "diffuse grid"),
        cone_table_(stream, static_cast<std::size_t>(field.cone_grid().entry_count()), cone_grid_.features(),
                    table_options(config, options, config.ncr_clusters, kPrefilteredTaps), "cone grid"),
        cone_(stream, field.cone_mlp().shape(), train_rows(options) * sizes_.each, "cone network",
              field.decoder().input_map(config.ncr_cone_features)),
        merge_(stream, field.merge_mlp().shape(), train_rows(options), "merge network"),
        items_(items_of(options)),
        cones_(items_ * sizes_.each),
        lobe_(stream, std::span<const LobeTable>(&field.lobe(), 1), "lobe angles"),
        list_(stream, rows_, "glossy points in flight"),
        counts_(stream, 2, "glossy points in flight"),
        cone_inputs_(stream, sizes_.cone_pairs * cones_, "cones in flight"),
        merge_inputs_(stream, sizes_.merge_pairs * items_, "glossy points in flight"),
        cone_p_(stream, 3 * cones_, "cones in flight"),
        cone_r_(stream, cones_, "cones in flight"),
        cone_linear_(stream, 3 * cones_, "cones in flight"),
        merge_linear_(stream, 3 * items_, "glossy points in flight") {
    holds(field, {&cone_, &merge_}, {&table_, &cone_table_});
    if (trains()) {
      const std::string glossy = "glossy training points in flight";
      const std::size_t n = train_rows_;
      slope_ = DeviceArray<float>(stream, 3 * n, glossy);
      d_merge_linear_ = DeviceArray<float>(stream, 3 * n, glossy);
      d_merge_inputs_ = DeviceArray<float>(stream, 6 * n, glossy);
      d_cone_linear_ = DeviceArray<float>(stream, 3 * n * sizes_.each, glossy);
      d_cone_inputs_ = DeviceArray<float>(stream, sizes_.features * n * sizes_.each, glossy);
      scales_ = DeviceArray<float>(stream, 4, glossy);
    }
    upload_from(field);
  }

  static std::vector<MemoryPart> memory(const Config& config, const DeviceFieldOptions& options) {
    const Sizes sizes(config);
    const std::size_t n = train_rows(options), items = items_of(options), cones = items * sizes.each;
    std::vector<MemoryPart> parts = decoder_memory(ncr_decoder_shape(config), options);
    append(parts, DeviceTable::memory(
                      static_cast<std::size_t>(hash_grid_entries(ncr_grid_options(config))), config.ncr_features,
                      table_options(config, options, config.ncr_levels, kHashGridTaps), "diffuse grid"));
    append(parts,
           DeviceTable::memory(static_cast<std::size_t>(hash_grid_entries(ncr_cone_grid_options(config))),
                               config.ncr_cone_features,
                               table_options(config, options, config.ncr_clusters, kPrefilteredTaps), "cone grid"));
    append(parts, network_memory(ncr_cone_shape(config), n * sizes.each, "cone network"));
    append(parts, network_memory(ncr_merge_shape(config), n, "merge network"));
    parts.push_back({"cones and glossy points in flight",
                     (rows(options) + cones * (sizes.cone_pairs + 7) + items * (sizes.merge_pairs + 3)) * 4});
    if (n > 0) parts.push_back({"glossy training points in flight", n * (12 + sizes.each * (3 + sizes.features)) * 4});
    return parts;
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

  void refine(const Chunk& chunk, FloatRows linear) override {
    if (chunk.training) {
      evaluate(items(chunk), chunk.n, {}, true, linear);
      return;
    }
    stream_.fill(counts_.data(), 0, sizeof(std::uint32_t));
    launch(stream_, chunk.n,
           ListGlossy{{}, chunk.points, chunk.slice, rules_.rough_threshold, list_.data(), counts_.data()});
    launch(stream_, 1, CountCones{{}, counts_.data(), counts_.data() + 1, each_});
    for (std::uint32_t begin = 0; begin < chunk.n; begin += static_cast<std::uint32_t>(items_)) {
      Items some = items(chunk);
      some.list = list_.data() + begin;
      some.slice = {counts_.data(), begin};
      evaluate(some, std::min(static_cast<std::uint32_t>(items_), chunk.n - begin), {counts_.data() + 1, begin * each_},
               false, linear);
    }
  }

  void refine_backward(const Chunk& chunk, bool first) override {
    const Items items = this->items(chunk);
    const std::uint32_t cones = chunk.n * each_;
    const std::size_t cone_rows = train_rows_ * sizes_.each;
    const FloatRows d_linear{d_linear_.data(), train_rows_}, d_merge_linear{d_merge_linear_.data(), train_rows_},
        d_merge_inputs{d_merge_inputs_.data(), train_rows_}, d_cone_linear{d_cone_linear_.data(), cone_rows},
        d_cone_inputs{d_cone_inputs_.data(), cone_rows};
    float *const merge_scale = scales_.data(), *const cone_scale = merge_scale + 2;
    launch(stream_, chunk.n, ToMerge{{}, items, d_linear, d_merge_linear, largest_.data()});
    choose_scale(merge_scale);
    merge_.backward(stream_, {merge_inputs_.data(), items_}, d_merge_linear, merge_scale, d_merge_inputs, 6, chunk.n,
                    !first);
    launch(stream_, chunk.n,
           ToBranches{{},
                      items,
                      each_,
                      rules_.activation,
                      d_merge_inputs,
                      {slope_.data(), train_rows_},
                      {cone_linear_.data(), cones_},
                      d_linear,
                      d_cone_linear,
                      largest_.data(),
                      &counters_.data()->non_finite});
    choose_scales(scale_.data(), cone_scale);
    cone_.backward(stream_, {cone_inputs_.data(), cones_}, d_cone_linear, cone_scale, d_cone_inputs,
                   cone_grid_.features(), cones, !first);
    scatter(
        cone_table_,
        [&](const auto& sink) {
          cone_grid_.scatter(stream_, footprints(cones, {}), d_cone_inputs.data, cone_rows, sink);
        },
        kPrefilteredTaps, cones, 1, d_cone_inputs.data, cone_rows);
  }

 private:
  // Of all points of the chunk.
  Items items(const Chunk& chunk) const {
    return {chunk.points, nullptr, chunk.training ? valid_.data() : nullptr, chunk.slice, rules_.rough_threshold};
  }
  DeviceFootprints footprints(std::uint32_t cones, QueueSlice slice) const {
    return {cone_p_.data(), cone_r_.data(), cones_, slice, cones};
  }

  // Replaces the outputs of `n` items, those that are glossy.
  void evaluate(const Items& items, std::uint32_t n, QueueSlice cone_slice, bool training, FloatRows linear) {
    const std::uint32_t cones = n * each_;
    const int features = cone_grid_.features();
    const HalfRows cone_inputs{cone_inputs_.data(), cones_}, merge_inputs{merge_inputs_.data(), items_};
    const FloatRows cone_linear{cone_linear_.data(), cones_}, merge_linear{merge_linear_.data(), items_};
    launch(stream_, cones,
           Cones{{},
                 items,
                 each_,
                 rules_,
                 lobe_.data(),
                 origin_,
                 extent_,
                 {w_.data(), rows_},
                 features,
                 {cone_p_.data(), cones_},
                 cone_r_.data(),
                 cone_inputs});
    cone_grid_.lookup(stream_, read(cone_table_), footprints(cones, cone_slice), cone_inputs, 0);
    if (training) cone_.forward_keep(stream_, cone_inputs, cone_linear, cones);
    else cone_.forward(stream_, cone_inputs, cone_linear, cones, cone_slice);
    // There is memory for the slopes of a training chunk, and queries may be more.
    const FloatRows slope = training ? FloatRows{slope_.data(), train_rows_} : FloatRows{};
    launch(stream_, n, MergeInputs{{}, items, each_, rules_.activation, linear, cone_linear, merge_inputs, slope});
    if (training) merge_.forward_keep(stream_, merge_inputs, merge_linear, n);
    else merge_.forward(stream_, merge_inputs, merge_linear, n, items.slice);
    launch(stream_, n, Merged{{}, items, merge_linear, linear});
  }

  const Sizes sizes_;
  const std::uint32_t each_;  // clusters of a point
  const Vec3f origin_;
  const float extent_;
  DeviceHashGrid grid_;
  DevicePrefilteredGrid cone_grid_;
  DeviceTable table_, cone_table_;
  DeviceMlp cone_, merge_;
  const std::size_t items_, cones_;  // in flight; strides of the arrays below
  const DeviceArray<LobeTable> lobe_;
  const DeviceArray<std::uint32_t> list_, counts_;  // glossy points, how many, and how many cones they have
  const DeviceArray<std::uint32_t> cone_inputs_, merge_inputs_;
  const DeviceArray<float> cone_p_, cone_r_, cone_linear_, merge_linear_;
  DeviceArray<float> slope_, d_merge_linear_, d_merge_inputs_, d_cone_linear_, d_cone_inputs_, scales_;
};

}  // namespace

std::unique_ptr<DeviceField> make_device_ncr(Stream& stream, RadianceField& field, const Config& config,
                                             const DeviceFieldOptions& options) {
  return std::make_unique<DeviceNcrField>(stream, dynamic_cast<NcrField&>(field), config, options);
}

std::vector<MemoryPart> device_ncr_memory(const Config& config, const std::vector<long long>&,
                                          const DeviceFieldOptions& options) {
  return DeviceNcrField::memory(config, options);
}

}  // namespace octrad
