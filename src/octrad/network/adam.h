// Adam (Kingma & Ba 2015): dense, and touched-only for sparse tables with per-entry step counts.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

namespace octrad {

struct AdamOptions {
  double beta1 = 0.9, beta2 = 0.999, epsilon = 1e-8;
};

// Plain Adam over a dense array. Gradients that are not finite (or whose square is not) are taken as 0 and counted.
class DenseAdam {
 public:
  DenseAdam(std::size_t parameters, const AdamOptions& options);
  // Returns the number of non-finite gradients. Parallel, deterministic.
  std::int64_t step(std::span<float> parameters, std::span<const float> gradients, double rate);
  // State for checkpoints.
  std::span<float> m() { return m_; }
  std::span<float> v() { return v_; }
  std::int64_t& count() { return count_; }

 private:
  AdamOptions options_;
  std::vector<float> m_, v_;
  std::int64_t count_ = 0;
};

// One gradient contribution: `scale` times the C-vector at `source` of the upstream buffer, to `entry`.
struct SparseTap {
  std::uint32_t entry;
  std::uint32_t source;
  float scale;
};

// Adam over a table of entries of `features` floats where few entries get a gradient each step. Moments of untouched
// entries stay as they are (unlike dense Adam, where they decay); bias correction counts an entry's own steps.
// An entry is touched when it occurs in a tap, be its gradient 0 or not.
class SparseAdam {
 public:
  // Throws MemoryError when the address space for the moments, bytes(entries, features), cannot be had.
  SparseAdam(std::int64_t entries, int features, const AdamOptions& options);
  ~SparseAdam();
  SparseAdam(SparseAdam&&) noexcept;
  SparseAdam& operator=(SparseAdam&&) noexcept;
  // `blocks` are lists of contributions (one a block of the batch, in a fixed order); upstream is [source][features].
  // Contributions to an entry are summed in block and list order: the same bits at any thread count and on any
  // instruction set. Sums that are not finite are taken as 0 and counted, feature by feature.
  struct Result {
    std::int64_t touched = 0, non_finite = 0;
  };
  Result step(std::span<float> table, std::span<const std::span<const SparseTap>> blocks,
              std::span<const float> upstream, double rate);
  // `dense` mode: every entry is updated, with one global step count (the textbook definition; small tables).
  void set_dense(bool dense);
  // State for checkpoints: moments [entries][2][features] and counts [entries]. Zero pages until touched.
  std::span<float> moments();
  std::span<std::uint16_t> counts();
  std::int64_t& global_count();
  // Memory of the state once every entry was touched.
  static std::int64_t bytes(std::int64_t entries, int features);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace octrad
