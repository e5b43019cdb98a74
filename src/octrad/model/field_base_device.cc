#include <algorithm>
#include <cassert>
#include <cmath>
#include <iterator>

#include "octrad/base/bits.h"
#include "octrad/base/error.h"
#include "octrad/device/launch.h"
#include "octrad/model/field_base_device.h"
#include "octrad/model/field_storage.h"

namespace octrad {
namespace {

// What the point itself gives: direction w, the decoder's inputs, and when training whether all of it is finite.
struct Prepare : Kernel {
  SurfacePointArray points;
  QueueSlice slice;
  LookupRule rule;
  DecoderRules rules;
  int features;
  HalfRows inputs;
  float* w;
  std::size_t stride;
  float* x;  // training: positions
  std::size_t x_stride;
  std::uint32_t* valid;  // training

  OCTRAD_HD void operator()(std::uint32_t i) const {
    if (!slice.holds(i)) return;
    SurfacePoint p = points.load(i);
    if (valid != nullptr) {
      // One infinite number would be one in the sum of all rows' gradients.
      bool good = is_finite(p.x) && is_finite(p.n) && is_finite(p.wo) && is_finite(p.albedo) &&
                  std::isfinite(p.alpha) && std::isfinite(p.disparity);
      if (points.lobe.data != nullptr) {
        OCTRAD_UNROLL
        for (int k = 0; k < kHitClusters; ++k) {
          const HitCluster c = points.lobe.get(k, i);
          good = good && is_finite(Vec3f(c.distance, c.deviation, c.share));
        }
      }
      valid[i] = good ? 1u : 0u;
      if (!good) {
        p = SurfacePoint{};
        p.n = p.wo = Vec3f(0.0f, 0.0f, 1.0f);
      }
      x[i] = p.x.x;
      x[x_stride + i] = p.x.y;
      x[2 * x_stride + i] = p.x.z;
    }
    const Vec3f direction = lookup_direction(rule, p);
    w[i] = direction.x;
    w[stride + i] = direction.y;
    w[2 * stride + i] = direction.z;
    float numbers[kPointInputs + 1];
    decoder_inputs(rules, p, direction, numbers);
    numbers[kPointInputs] = 1.0f;  // for MlpInputMap; without one its weights are 0
    OCTRAD_UNROLL
    for (int k = 0; k <= kPointInputs; k += 2)
      inputs.store2(features + k, i, bounded_half(numbers[k]), bounded_half(numbers[k + 1]));
  }
};

struct Radiance : Kernel {
  SurfacePointArray points;
  QueueSlice slice;
  DecoderRules rules;
  const float* scalars;
  FloatRows linear;
  Vec3f* out;

  OCTRAD_HD void operator()(std::uint32_t i) const {
    if (!slice.holds(i)) return;
    const Vec3f of_point(linear.data[i], linear.data[linear.stride + i], linear.data[2 * linear.stride + i]);
    out[i] = decoder_radiance(rules, points.get3(9, i), points.get(kAlphaNumber, i), of_point, scalars[0]);
  }
};

struct Loss : Kernel {
  SurfacePointArray points;
  const std::uint32_t* valid;
  const Vec3f* targets;
  DecoderRules rules;
  const float* scalars;
  const StepConstants* constants;
  FloatRows linear;
  float norm;
  float* d_linear;  // [3][d_stride]
  std::size_t d_stride;
  float* row_losses;
  std::uint32_t* largest;  // bits of the largest gradient
  unsigned long long* non_finite;

  OCTRAD_HD void operator()(std::uint32_t i) const {
    PointLoss loss{};
    loss.dropped = 3;
    if (valid[i] != 0) {
      const Vec3f of_point(linear.data[i], linear.data[linear.stride + i], linear.data[2 * linear.stride + i]);
      loss = decoder_point_loss(rules, points.get3(9, i), points.get(kAlphaNumber, i), of_point, targets[i],
                                constants->epsilon, scalars[0], norm);
    }
    float sum = loss.chroma, most = 0.0f;
    OCTRAD_UNROLL
    for (int c = 0; c < 3; ++c) {
      sum += loss.value[c];
      d_linear[static_cast<std::size_t>(c) * d_stride + i] = loss.gradient[c];
      most = std::abs(loss.gradient[c]) > most ? std::abs(loss.gradient[c]) : most;
    }
    const auto dropped = static_cast<unsigned long long>(loss.dropped);
    row_losses[i] = sum;
    if (dropped > 0) atomic_add(non_finite, dropped);
    atomic_max(largest, magnitude_bits(most));
  }
};

// A power of 2 that brings the largest gradient to 16 .. 32: layers may make it 2,000 times as large before it is
// bounded, and gradients 2^18 times smaller are still held to full precision.
struct ChooseScale : Kernel {
  std::uint32_t* largest;
  float* scale;

  OCTRAD_HD void operator()(std::uint32_t) const {
    const int exponent = static_cast<int>(*largest >> 23) - 127;
    int up = 4 - exponent;
    up = *largest == 0 ? 0 : (up > 100 ? 100 : (up < -100 ? -100 : up));
    scale[0] = std::ldexp(1.0f, up);
    scale[1] = std::ldexp(1.0f, -up);
    *largest = 0;
  }
};

// After a chunk's loss: the scale of its gradients, and its sum. After the last one: the step is counted.
struct EndLoss : Kernel {
  ChooseScale choose;
  float* sum;  // of the chunk's rows; [1] adds up the step's
  bool first, last;
  float norm;
  TrainCounters* counters;

  OCTRAD_HD void operator()(std::uint32_t) const {
    choose(0);
    const float total = (first ? 0.0f : sum[1]) + sum[0];
    sum[1] = total;
    if (!last) return;
    counters->losses[counters->steps % DeviceField::kLossHistory] = total * norm;
    ++counters->steps;
  }
};

}  // namespace

std::vector<MemoryPart> DeviceFieldBase::network_memory(const MlpShape& shape, std::size_t train_rows,
                                                        const std::string& what) {
  std::vector<MemoryPart> parts = DeviceMlp::memory(shape, train_rows, what);
  if (train_rows > 0) parts.push_back({what + " optimiser", DeviceDenseAdam::bytes(shape.parameter_count())});
  return parts;
}

std::vector<MemoryPart> DeviceFieldBase::decoder_memory(const MlpShape& shape, const DeviceFieldOptions& options) {
  const std::size_t n = rows(options), t = train_rows(options);
  std::vector<MemoryPart> parts = network_memory(shape, t, "decoder");
  const auto pairs = static_cast<std::size_t>(shape.inputs + 1) / 2;
  parts.push_back({"queries in flight", n * (pairs + 3 + 3) * 4});
  if (t > 0) {
    parts.push_back(
        {"training points in flight", t * static_cast<std::size_t>(shape.inputs - kPointInputs + 3 + 3 + 2) * 4});
  }
  return parts;
}

DeviceTableOptions DeviceFieldBase::table_options(const Config& config, const DeviceFieldOptions& options, int levels,
                                                  int taps) {
  DeviceTableOptions table;
  table.halves = options.half_features;
  table.training = options.max_train_points > 0;
  table.masters = options.averages;
  table.dense = config.adam_mode == AdamMode::dense;
  table.sorted = table.training && options.deterministic;
  // The list of touched entries is that of a whole step, the sort works on a chunk.
  table.touches = options.max_train_points * static_cast<std::size_t>(levels * taps);
  table.slots = train_rows(options) * static_cast<std::size_t>(levels * taps);
  table.scan_touched = options.tuning.scan_touched;
  table.half_moments = options.tuning.half_moments;
  table.adam = adam_options(config);
  return table;
}

DeviceFieldBase::DeviceFieldBase(Stream& stream, FieldBase& field, const Config& config,
                                 const DeviceFieldOptions& options)
    : stream_(stream),
      config_(config),
      options_(options),
      rules_(field.decoder().half_rules()),
      features_(field.decoder().mlp().shape().inputs - kPointInputs),
      rows_(rows(options)),
      train_rows_(train_rows(options)),
      decoder_(stream, field.decoder().mlp().shape(), train_rows(options), "decoder",
               field.decoder().input_map(features_)),
      scalars_(stream, 1, "constants"),
      inputs_(stream, static_cast<std::size_t>(field.decoder().mlp().shape().inputs + 1) / 2 * rows_,
              "queries in flight"),
      w_(stream, 3 * rows_, "queries in flight"),
      linear_(stream, 3 * rows_, "queries in flight") {
  if (options.max_train_points == 0) return;
  const std::size_t n = train_rows_;
  x_ = DeviceArray<float>(stream, 3 * n, "training points in flight");
  d_linear_ = DeviceArray<float>(stream, 3 * n, "training points in flight");
  d_inputs_ = DeviceArray<float>(stream, static_cast<std::size_t>(features_) * n, "training points in flight");
  row_losses_ = DeviceArray<float>(stream, n, "training points in flight");
  loss_sum_ = DeviceArray<float>(stream, 2, "training points in flight");
  valid_ = DeviceArray<std::uint32_t>(stream, n, "training points in flight");
  largest_ = DeviceArray<std::uint32_t>(stream, 2, "training points in flight");
  largest_.fill(0);
  scale_ = DeviceArray<float>(stream, 2, "training points in flight");
  counters_ = DeviceArray<TrainCounters>(stream, 1, "training points in flight");
  counters_.fill(0);
  sum_workspace_ = SortWorkspace(stream, n, "training points in flight");
}

void DeviceFieldBase::holds(FieldBase& field, const std::vector<DeviceMlp*>& networks,
                            const std::vector<DeviceTable*>& tables) {
  networks_ = {&decoder_};
  networks_.insert(networks_.end(), networks.begin(), networks.end());
  tables_ = tables;
  assert(networks_.size() == field.networks().size() && tables_.size() == field.tables().size());
  if (!trains()) return;
  for (std::size_t i = 0; i < networks_.size(); ++i) {
    DeviceMlp& network = *networks_[i];
    adams_.emplace_back(stream_, network.parameter_count(), adam_options(config_), network.name());
    optimizers_.add(adams_.back(), network.weights().data(), network.gradient().data(), config_.adam_rate_networks);
  }
  for (std::size_t i = 0; i < tables_.size(); ++i) optimizers_.add(*tables_[i], field.tables()[i].rate);
}

DeviceQueries DeviceFieldBase::queries(const Chunk& chunk) const {
  DeviceQueries q;
  q.x = chunk.training ? x_.data() : chunk.points.data;
  q.x_stride = chunk.training ? train_rows_ : chunk.points.stride;
  q.w = w_.data();
  q.w_stride = rows_;
  q.slice = chunk.slice;
  q.n = chunk.n;
  return q;
}

void DeviceFieldBase::prepare(const Chunk& chunk) {
  launch(stream_, chunk.n,
         Prepare{{},
                 chunk.points,
                 chunk.slice,
                 rule(),
                 rules_,
                 features_,
                 {inputs_.data(), rows_},
                 w_.data(),
                 rows_,
                 chunk.training ? x_.data() : nullptr,
                 train_rows_,
                 chunk.training ? valid_.data() : nullptr});
}

void DeviceFieldBase::choose_scale(float* scale) { launch(stream_, 1, ChooseScale{{}, largest_.data(), scale}); }

void DeviceFieldBase::choose_scales(float* first, float* second) {
  const LaunchPart<ChooseScale> parts[] = {{1, {{}, largest_.data(), first}}, {1, {{}, largest_.data() + 1, second}}};
  launch_parts(stream_, parts, std::size(parts));
}

void DeviceFieldBase::radiance(SurfacePointArray points, const std::uint32_t* count, std::size_t capacity, Vec3f* out) {
  for (std::size_t begin = 0; begin < capacity; begin += options_.max_points) {
    const Chunk chunk{points.from(begin),
                      {count, static_cast<std::uint32_t>(begin)},
                      static_cast<std::uint32_t>(std::min(options_.max_points, capacity - begin)),
                      false};
    prepare(chunk);
    stream_.mark("inputs of queries");
    encode(chunk);
    stream_.mark("look-up");
    const FloatRows linear{linear_.data(), rows_};
    decoder_.forward(stream_, {inputs_.data(), rows_}, linear, chunk.n, chunk.slice);
    stream_.mark("decoder");
    refine(chunk, linear);
    launch(stream_, chunk.n, Radiance{{}, chunk.points, chunk.slice, rules_, scalars_.data(), linear, out + begin});
    stream_.mark("radiance");
  }
}

void DeviceFieldBase::train(SurfacePointArray points, const Vec3f* targets, std::size_t n,
                            const StepConstants* constants) {
  if (n > options_.max_train_points) throw DeviceError("a training step of more points than there is memory for");
  if (n == 0) return;
  const float norm = 1.0f / (3.0f * static_cast<float>(n));
  const HalfRows inputs{inputs_.data(), rows_};
  const FloatRows linear{linear_.data(), rows_};
  const std::size_t chunk_rows = train_rows_;
  TrainCounters* counters = counters_.data();
  for (std::size_t begin = 0; begin < n; begin += chunk_rows) {
    const Chunk chunk{points.from(begin), {}, static_cast<std::uint32_t>(std::min(chunk_rows, n - begin)), true};
    const bool first = begin == 0, last = begin + chunk_rows >= n;
    prepare(chunk);
    encode(chunk);
    decoder_.forward_keep(stream_, inputs, linear, chunk.n);
    refine(chunk, linear);
    stream_.mark("training forward");
    launch(stream_, chunk.n,
           Loss{{},
                chunk.points,
                valid_.data(),
                targets + begin,
                rules_,
                scalars_.data(),
                constants,
                linear,
                norm,
                d_linear_.data(),
                train_rows_,
                row_losses_.data(),
                largest_.data(),
                &counters->non_finite});
    sum(stream_, sum_workspace_, chunk.n, row_losses_.data(), loss_sum_.data());
    launch(stream_, 1,
           EndLoss{{}, {{}, largest_.data(), scale_.data()}, loss_sum_.data(), first, last, norm, counters});
    stream_.mark("loss");
    refine_backward(chunk, first);
    decoder_.backward(stream_, inputs, {d_linear_.data(), train_rows_}, scale_.data(), {d_inputs_.data(), train_rows_},
                      features_, chunk.n, !first);
    stream_.mark("decoder backward");
    encode_backward(chunk, first);
    stream_.mark("tables' gradients");
  }
  optimizers_.advance(stream_, &constants->network_scale, &constants->rate_scale, &counters->touched);
  optimizers_.step_tables(stream_, &counters->non_finite);
  stream_.mark("tables' optimiser");
  optimizers_.step_networks(stream_, &counters->non_finite);
  DeviceMlp::refresh_all(stream_, networks_);
  stream_.mark("networks' optimiser");
}

DeviceTrainReport DeviceFieldBase::collect() {
  DeviceTrainReport report;
  if (counters_.empty()) return report;
  const TrainCounters counters = counters_.download()[0];
  counters_.fill(0);
  report.steps = static_cast<long long>(counters.steps);
  report.non_finite = static_cast<long long>(counters.non_finite);
  report.touched = static_cast<long long>(counters.touched);
  const unsigned long long kept = std::min<unsigned long long>(counters.steps, kLossHistory);
  for (unsigned long long s = counters.steps - kept; s < counters.steps; ++s)
    report.losses.push_back(static_cast<double>(counters.losses[s % kLossHistory]));
  return report;
}

void DeviceFieldBase::inspect(SurfacePointArray points, std::size_t n, FloatRows out, float* disparity) {
  for (std::size_t begin = 0; begin < n; begin += options_.max_points) {
    const Chunk chunk{
        points.from(begin), {}, static_cast<std::uint32_t>(std::min(options_.max_points, n - begin)), false};
    prepare(chunk);
    encode(chunk);
    if (out.data != nullptr) features(chunk, {out.data + begin, out.stride});
    if (disparity == nullptr) continue;
    if (disparities() != nullptr) stream_.copy(disparity + begin, disparities(), chunk.n * sizeof(float));
    else stream_.fill(disparity + begin, 0, chunk.n * sizeof(float));
  }
}

void DeviceFieldBase::approach(const DeviceField& to, float share) {
  const auto* other = dynamic_cast<const DeviceFieldBase*>(&to);
  if (other == nullptr || other->networks_.size() != networks_.size() || other->tables_.size() != tables_.size())
    throw InputError("a field on the device approaches one of its own kind");
  // Tables first: they may have no floats to move, which is found before anything has moved.
  for (std::size_t i = 0; i < tables_.size(); ++i) tables_[i]->approach(stream_, *other->tables_[i], share);
  for (std::size_t i = 0; i < networks_.size(); ++i)
    octrad::approach(stream_, networks_[i]->weights(), other->networks_[i]->weights(), share);
  DeviceMlp::refresh_all(stream_, networks_);
}

void DeviceFieldBase::set_target_scale(float scale) {
  target_scale_ = scale;
  scalars_.upload(std::span<const float>(&target_scale_, 1));
}

// A field of the CPU that can be the one that this was made from.
FieldBase& DeviceFieldBase::same_shapes(RadianceField& field) const {
  auto* base = dynamic_cast<FieldBase*>(&field);
  bool same = base != nullptr && base->networks().size() == networks_.size() && base->tables().size() == tables_.size();
  for (std::size_t i = 0; same && i < networks_.size(); ++i)
    same = base->networks()[i].mlp->shape() == networks_[i]->shape();
  for (std::size_t i = 0; same && i < tables_.size(); ++i) {
    const FieldTable& table = base->tables()[i];
    same =
        static_cast<std::size_t>(table.entries()) == tables_[i]->entries() && table.features == tables_[i]->features();
  }
  if (!same) throw InputError("the field on the device and the field given have different shapes");
  return *base;
}

void DeviceFieldBase::upload_from(RadianceField& from) {
  FieldBase& field = same_shapes(from);
  for (std::size_t i = 0; i < networks_.size(); ++i) {
    FieldNetwork& network = field.networks()[i];
    networks_[i]->weights().upload(network.mlp->weights());
    if (trains()) adams_[i].upload(network.adam);
  }
  DeviceMlp::refresh_all(stream_, networks_);
  for (std::size_t i = 0; i < tables_.size(); ++i)
    tables_[i]->upload(stream_, field.tables()[i].values, field.tables()[i].adam.get());
  set_target_scale(field.target_scale());
}

void DeviceFieldBase::download_to(RadianceField& to) {
  FieldBase& field = same_shapes(to);
  if (!trains() && !options_.averages)
    throw DeviceError("a field that is not trained on the device is not copied back from it");
  if (trains()) field.make_optimizers();
  for (std::size_t i = 0; i < networks_.size(); ++i) {
    FieldNetwork& network = field.networks()[i];
    networks_[i]->weights().download(network.mlp->weights());
    if (trains()) adams_[i].download(network.adam);
  }
  for (std::size_t i = 0; i < tables_.size(); ++i)
    tables_[i]->download(field.tables()[i].values, field.tables()[i].adam.get());
  field.weights_changed();
  field.set_target_scale(target_scale_);
}

}  // namespace octrad
