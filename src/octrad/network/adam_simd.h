// The inner loops of Adam, chosen for the processor at run time. Same bits on every instruction set.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "octrad/network/adam.h"
#include "octrad/network/adam_math.h"

namespace octrad {

// Updates n parameters with their gradients; returns how many gradients were not usable (taken as 0).
std::int64_t adam_dense_kernel(std::size_t n, float* parameters, const float* gradients, float* m, float* v,
                               const AdamConstants& k, float scaled_rate, float second);

// What the sparse kernels share.
struct SparseAdamView {
  std::size_t features = 0;
  float* table = nullptr;           // [entries][features]
  float* moments = nullptr;         // [entries][2][features]: m, v
  std::uint16_t* counts = nullptr;  // [entries]
  const float* upstream = nullptr;  // [sources][features]
  AdamConstants constants{};
  const AdamCorrection* corrections = nullptr;  // by min(count, last_correction); index 0 is unused
  std::size_t last_correction = 0;
  float rate = 0.0f;
};

// Scratch of one task; kept by its thread so that it is allocated once.
struct SparseAdamScratch {
  std::vector<std::uint32_t> slots;    // open addressing: index of the entry in `entries`, or ~0
  std::vector<std::uint32_t> entries;  // distinct entries in the order of their first contribution
  std::vector<float> gradients;        // [entries][features]
};

struct SparseAdamCounts {
  std::int64_t touched = 0, non_finite = 0;
};

// Sums the contributions of `taps` by entry, in order, and updates the entries that occur.
SparseAdamCounts adam_sparse_kernel(const SparseAdamView& view, std::span<const SparseTap> taps,
                                    SparseAdamScratch& scratch);

// Dense definition: `taps` fall into [first, first + entries); all of these are updated with `correction`.
SparseAdamCounts adam_range_kernel(const SparseAdamView& view, std::span<const SparseTap> taps, std::size_t first,
                                   std::size_t entries, AdamCorrection correction, SparseAdamScratch& scratch);

}  // namespace octrad
