// Adam on a device, with the semantics of adam.h: dense for networks; for feature tables touched entries only (with
// their own step counts) or all. A table keeps float masters and, by option, the halves that look-ups read.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "octrad/base/bytes.h"
#include "octrad/base/half.h"
#include "octrad/device/array.h"
#include "octrad/device/rows.h"
#include "octrad/device/sort.h"
#include "octrad/network/adam.h"
#include "octrad/network/adam_math.h"

namespace octrad {

// What the kernels of the current step need; in device memory, advanced by a kernel.
struct AdamStep {
  std::int64_t count = 0;  // steps done
  float rate = 0.0f;       // of this step, and times correction.first
  float scaled_rate = 0.0f;
  float second = 0.0f;
  std::uint32_t listed = 0;  // entries of a table that it moves, where they are listed
  std::uint64_t random = 0;  // bits of this step
};

class DeviceDenseAdam {
 public:
  DeviceDenseAdam() = default;
  DeviceDenseAdam(Stream& stream, std::size_t parameters, const AdamOptions& options, const std::string& what);
  static std::uint64_t bytes(std::size_t parameters) { return parameters * 2 * sizeof(float); }
  void upload(DenseAdam& from);
  void download(DenseAdam& to) const;

 private:
  friend class DeviceOptimizers;
  AdamOptions options_;
  DeviceArray<float> m_, v_;
  DeviceArray<AdamStep> step_;
};

struct DeviceTableOptions {
  bool halves = true;  // look-ups read halves
  bool training = false;
  bool masters = false;       // without training: floats beside the halves all the same, for approach() and download()
  bool dense = false;         // Adam over every entry
  bool half_moments = false;  // with `dense`: both moments in 32 bits (packed_moments_math.h), of a step's own rounding
  bool sorted = false;        // contributions summed in a fixed order
  bool scan_touched = false;  // contributions only set bits, from which step() makes the list, in order
  std::size_t touches = 0;    // most entries that a step can touch (at most all)
  std::size_t slots = 0;      // most contributions between begin_sorted() and sum_sorted()
  AdamOptions adam;
};

// A table of feature vectors [entries][features] with its optimiser.
class DeviceTable {
 public:
  DeviceTable(Stream& stream, std::size_t entries, int features, const DeviceTableOptions& options,
              const std::string& what);
  static std::vector<MemoryPart> memory(std::size_t entries, int features, const DeviceTableOptions& options,
                                        const std::string& what);

  // Exactly one of the two is set.
  const Half* halves() const { return halves_.data(); }
  const float* floats() const { return halves_.empty() ? values_.data() : nullptr; }
  std::size_t entries() const { return entries_; }
  int features() const { return features_; }

  // The optimiser's state may be null: zeros.
  void upload(Stream& stream, std::span<const float> values, SparseAdam* adam);
  // Needs `training`, `masters`, or a table of floats, as does approach().
  void download(std::span<float> values, SparseAdam* adam) const;
  // Every value by `share` of the way to that of `to`, a table of the same size.
  void approach(Stream& stream, const DeviceTable& to, float share);

  // The sink of a step's contributions: add(), or with options.sorted keep() after begin_sorted().
  AddNow add() const;
  void begin_sorted(Stream& stream);
  KeepForSort keep() const { return {slot_rows_.data(), slot_scales_.data()}; }
  // Sums the contributions of keep() by entry, in the order of slots, and adds them to the step's gradient: slot s, one
  // of `taps` an item, adds its scale times the upstream gradient of item s / taps = level n + i, upstream[level
  // features + c][i].
  void sum_sorted(Stream& stream, int taps, std::uint32_t n, int levels, const float* upstream,
                  std::size_t upstream_stride);

 private:
  friend class DeviceOptimizers;
  TouchedRows marked() const;  // what contributions leave behind
  void step(Stream& stream, unsigned long long* non_finite);

  std::size_t entries_;
  int features_;
  DeviceTableOptions options_;
  std::size_t capacity_ = 0;  // of the touched list
  std::uint32_t last_correction_ = 0;
  DeviceArray<Half> halves_;
  DeviceArray<float> values_, moments_, gradient_;
  DeviceArray<std::uint32_t> packed_moments_;  // instead of moments_
  DeviceArray<std::uint16_t> counts_;
  DeviceArray<std::uint32_t> bits_, list_, list_count_;
  DeviceArray<AdamCorrection> corrections_;
  DeviceArray<AdamStep> step_;  // of dense mode; its count also counts the steps of the other
  DeviceArray<std::uint32_t> slot_rows_, slot_numbers_, sorted_rows_, sorted_slots_;
  DeviceArray<float> slot_scales_;
  SortWorkspace workspace_;
};

// Each of `values` by `share` of the way to that of `to`, of the same size.
void approach(Stream& stream, DeviceArray<float>& values, const DeviceArray<float>& to, float share);

// All optimisers of a model. They step together, so that what takes a thread or few parameters takes one launch for all
// of them. What is added stays where it is.
class DeviceOptimizers {
 public:
  void add(DeviceDenseAdam& adam, float* parameters, const float* gradients, double rate);
  void add(DeviceTable& table, double rate);

  // One step of all, at their rates times *network_scale and *table_scale (device memory): advance(), then the others
  // in any order. The counters are added to, *touched by entries of tables that the step updates; gradients that are
  // not usable count as 0 and are in *non_finite. A table's gradient is cleared. All pointers are to device memory.
  void advance(Stream& stream, const float* network_scale, const float* table_scale, unsigned long long* touched) const;
  void step_networks(Stream& stream, unsigned long long* non_finite) const;
  void step_tables(Stream& stream, unsigned long long* non_finite) const;

 private:
  struct Network {
    DeviceDenseAdam* adam;
    float* parameters;
    const float* gradients;
    double rate;
  };
  struct Table {
    DeviceTable* table;
    double rate;
  };
  std::vector<Network> networks_;
  std::vector<Table> tables_;
};

}  // namespace octrad
