// What device fields have in common: the decoder with its inputs and loss, all optimisers, and copies from and to
// fields of the CPU (field_base.h). Not for users.
#pragma once

#include <algorithm>
#include <cmath>
#include <deque>
#include <initializer_list>
#include <string>
#include <vector>

#include "octrad/base/bits.h"
#include "octrad/base/lookup_rule.h"
#include "octrad/base/vec.h"
#include "octrad/device/array.h"
#include "octrad/device/rows.h"
#include "octrad/device/sort.h"
#include "octrad/encoding/lookup_device.h"
#include "octrad/model/device_field.h"
#include "octrad/model/field_base.h"
#include "octrad/network/adam_device.h"
#include "octrad/network/mlp_device.h"

namespace octrad {

// In device memory.
struct TrainCounters {
  unsigned long long non_finite = 0, touched = 0, steps = 0;
  float losses[DeviceField::kLossHistory] = {};
};

// Grows with |x|; of a vector: with its largest component.
OCTRAD_HD inline std::uint32_t magnitude_bits(float x) { return bits_of(x) & 0x7fffffffu; }
OCTRAD_HD inline std::uint32_t magnitude_bits(Vec3f v) {
  return magnitude_bits(max_component(Vec3f(std::abs(v.x), std::abs(v.y), std::abs(v.z))));
}

class DeviceFieldBase : public DeviceField {
 public:
  // Rows in flight for training, and at most.
  static std::size_t train_rows(const DeviceFieldOptions& options) {
    return std::min(options.max_train_points, static_cast<std::size_t>(options.tuning.train_chunk));
  }
  static std::size_t rows(const DeviceFieldOptions& options) {
    return std::max(options.max_points, train_rows(options));
  }
  // Of a network, and of its optimiser where it has rows for training.
  static std::vector<MemoryPart> network_memory(const MlpShape& shape, std::size_t train_rows, const std::string& what);
  static std::vector<MemoryPart> decoder_memory(const MlpShape& shape, const DeviceFieldOptions& options);
  static DeviceTableOptions table_options(const Config& config, const DeviceFieldOptions& options, int levels,
                                          int taps);

  DeviceFieldBase(Stream& stream, FieldBase& field, const Config& config, const DeviceFieldOptions& options);

  void radiance(SurfacePointArray points, const std::uint32_t* count, std::size_t capacity, Vec3f* out) override;
  void train(SurfacePointArray points, const Vec3f* targets, std::size_t n, const StepConstants* constants) override;
  DeviceTrainReport collect() override;
  void inspect(SurfacePointArray points, std::size_t n, FloatRows features, float* disparity) override;
  void upload_from(RadianceField& field) override;
  void download_to(RadianceField& field) override;
  void approach(const DeviceField& to, float share) override;
  void set_target_scale(float scale) override;
  float target_scale() const override { return target_scale_; }

 protected:
  // The rows of one chunk.
  struct Chunk {
    SurfacePointArray points;  // its first one is row 0
    QueueSlice slice;
    std::uint32_t n = 0;
    bool training = false;
  };
  // Positions (when training: of points that were found to be in order), directions w and the inputs of the decoder
  // that the point itself gives are ready; fills inputs_ from number 0 on, keeping what encode_backward and
  // disparities() need.
  virtual void encode(const Chunk& chunk) = 0;
  // `linear` [3][..] holds the decoder's outputs; replaces those of points that show something else.
  virtual void refine(const Chunk&, FloatRows) {}
  // d_linear_ holds the gradient at the outputs after refine(), and scale_ its loss scale; makes of it the gradient at
  // those before, and its scale.
  virtual void refine_backward(const Chunk&, bool) {}
  // d_inputs_ holds the gradient at the features.
  virtual void encode_backward(const Chunk& chunk, bool first) = 0;
  // For inspect(), after encode().
  virtual void features(const Chunk& chunk, FloatRows out) = 0;
  virtual const float* disparities() const { return nullptr; }
  virtual LookupRule rule() const { return {LookupDirection::mirror, RoughDirection::mirror, 0.5f}; }

  static DeviceFeatures read(const DeviceTable& table) { return {table.floats(), table.halves()}; }
  DeviceQueries queries(const Chunk& chunk) const;
  // In constructors: the counterparts of networks beside the decoder and of tables, in the order of the field's.
  void holds(FieldBase& field, const std::vector<DeviceMlp*>& networks, const std::vector<DeviceTable*>& tables);
  bool trains() const { return options_.max_train_points > 0; }
  // Loss scale, and its inverse, of gradients (finite) in a backward pass of halves, the kernel before having left the
  // bits of the largest at largest_; of two kinds of them at largest_ and the next. It is 0 again afterwards.
  void choose_scale(float* scale);
  void choose_scales(float* first, float* second);
  // Sums gradients of table rows, in a fixed order where the options say so.
  template <typename Scatter>
  void scatter(DeviceTable& table, const Scatter& scatter, int taps, std::uint32_t n, int levels, const float* upstream,
               std::size_t upstream_stride) {
    if (!options_.deterministic) {
      scatter(table.add());
      return;
    }
    table.begin_sorted(stream_);
    scatter(table.keep());
    table.sum_sorted(stream_, taps, n, levels, upstream, upstream_stride);
  }

  Stream& stream_;
  const Config config_;
  const DeviceFieldOptions options_;
  const DecoderRules rules_;
  const int features_;      // the encoding's, at the front of the decoder's inputs
  std::size_t rows_;        // stride of the arrays below
  std::size_t train_rows_;  // stride of those that only training has
  DeviceMlp decoder_;
  float target_scale_ = 1.0f;
  DeviceArray<float> scalars_;  // target_scale
  DeviceArray<std::uint32_t> inputs_;
  DeviceArray<float> w_, linear_;
  // Training only.
  DeviceArray<float> x_, d_linear_, d_inputs_, row_losses_, loss_sum_;
  DeviceArray<std::uint32_t> valid_, largest_;  // largest_: magnitude_bits() of gradients, for atomic_max()
  DeviceArray<float> scale_;                    // of gradients while they are halves: value and inverse
  DeviceArray<TrainCounters> counters_;
  SortWorkspace sum_workspace_;

 private:
  void prepare(const Chunk& chunk);
  FieldBase& same_shapes(RadianceField& field) const;

  DeviceOptimizers optimizers_;
  std::vector<DeviceMlp*> networks_;   // the decoder first
  std::deque<DeviceDenseAdam> adams_;  // of networks_, when training
  std::vector<DeviceTable*> tables_;
};

}  // namespace octrad
