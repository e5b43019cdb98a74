#include "octrad/network/adam.h"

#include <sys/mman.h>

#include <algorithm>
#include <bit>
#include <cassert>
#include <string>

#include "octrad/base/error.h"
#include "octrad/base/threads.h"
#include "octrad/network/adam_simd.h"

namespace octrad {
namespace {

// A zeroed array whose pages exist only once they are written, on huge pages where the system grants them (random
// entries of gigabytes: without, half the time goes into address translation).
template <typename T>
class LazyArray {
 public:
  explicit LazyArray(std::size_t count) : count_(count) {
    void* p = ::mmap(nullptr, bytes(), PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
    if (p == MAP_FAILED) {
      throw MemoryError("cannot map " + std::to_string(bytes() >> 20) +
                        " MiB for the optimiser's state; fewer octree.levels or octree.features need less");
    }
    if (bytes() >= (std::size_t{4} << 20))
      ::madvise(p, bytes(), MADV_HUGEPAGE);  // advice: failure changes nothing but speed
    data_ = static_cast<T*>(p);
  }
  ~LazyArray() { ::munmap(data_, bytes()); }
  LazyArray(const LazyArray&) = delete;
  LazyArray& operator=(const LazyArray&) = delete;
  T* data() { return data_; }
  std::span<T> span() { return {data_, count_}; }

 private:
  std::size_t bytes() const { return std::max<std::size_t>(count_, 1) * sizeof(T); }
  std::size_t count_;
  T* data_;
};

constexpr std::size_t kDenseBlock = 16384;  // parameters a task

SparseAdamScratch& task_scratch() {
  thread_local SparseAdamScratch scratch;
  return scratch;
}

}  // namespace

DenseAdam::DenseAdam(std::size_t parameters, const AdamOptions& options)
    : options_(options),
      m_(parameters),
      v_(parameters) {}

std::int64_t DenseAdam::step(std::span<float> parameters, std::span<const float> gradients, double rate) {
  assert(parameters.size() == m_.size() && gradients.size() == m_.size());
  ++count_;
  const AdamConstants k = adam_constants(options_.beta1, options_.beta2, options_.epsilon);
  const AdamCorrection correction = adam_correction(options_.beta1, options_.beta2, static_cast<double>(count_));
  const float scaled_rate = static_cast<float>(rate) * correction.first;
  std::vector<std::int64_t> dropped((m_.size() + kDenseBlock - 1) / kDenseBlock);
  parallel_blocks(m_.size(), kDenseBlock, [&](std::size_t begin, std::size_t end) {
    dropped[begin / kDenseBlock] =
        adam_dense_kernel(end - begin, parameters.data() + begin, gradients.data() + begin, m_.data() + begin,
                          v_.data() + begin, k, scaled_rate, correction.second);
  });
  std::int64_t total = 0;
  for (std::int64_t d : dropped) total += d;
  return total;
}

// Contributions are distributed into buckets by entry (a stable counting sort: order within an entry is kept), and
// every bucket is summed and applied by one task. Neither the pieces nor the buckets depend on the number of threads.
struct SparseAdam::Impl {
  Impl(std::int64_t entry_count, int feature_count, const AdamOptions& adam_options)
      : entries(static_cast<std::size_t>(entry_count)),
        features(static_cast<std::size_t>(feature_count)),
        options(adam_options),
        moments(entries * 2 * features),
        counts(entries) {
    // Until both corrections have become exactly 1 in float, or the count saturates.
    corrections.push_back({0.0f, 0.0f});
    do {
      corrections.push_back(adam_correction(options.beta1, options.beta2, static_cast<double>(corrections.size())));
    } while (corrections.size() <= 0xffff && (corrections.back().first > 1.0f || corrections.back().second > 1.0f));
  }

  // Sorts the taps of all blocks into sorted[bucket_begin[b] .. bucket_begin[b + 1]), b = bucket_of(entry).
  template <typename BucketOf>
  void sort(std::span<const std::span<const SparseTap>> blocks, std::size_t buckets, const BucketOf& bucket_of);

  std::size_t entries, features;
  AdamOptions options;
  LazyArray<float> moments;
  LazyArray<std::uint16_t> counts;
  std::vector<AdamCorrection> corrections;
  std::int64_t global_count = 0;
  bool dense = false;

  std::vector<std::span<const SparseTap>> pieces;
  std::vector<std::uint32_t> offsets;  // [piece][bucket]
  std::vector<std::size_t> bucket_begin;
  std::vector<SparseTap> sorted;
};

template <typename BucketOf>
void SparseAdam::Impl::sort(std::span<const std::span<const SparseTap>> blocks, std::size_t buckets,
                            const BucketOf& bucket_of) {
  std::size_t total = 0;
  for (const auto& block : blocks) total += block.size();
  assert(total < 0xffffffffu);
  // Large pieces when there are many buckets: the table of offsets is written once per piece.
  const std::size_t piece_size = std::max<std::size_t>(4096, 4 * buckets);
  pieces.clear();
  for (const auto& block : blocks) {
    for (std::size_t begin = 0; begin < block.size(); begin += piece_size) {
      pieces.push_back(block.subspan(begin, std::min(piece_size, block.size() - begin)));
    }
  }
  offsets.assign(pieces.size() * buckets, 0);
  parallel_for(pieces.size(), [&](std::size_t p) {
    std::uint32_t* count = offsets.data() + p * buckets;
    for (const SparseTap& tap : pieces[p]) {
      assert(tap.entry < entries);
      ++count[bucket_of(tap.entry)];
    }
  });
  bucket_begin.resize(buckets + 1);
  std::uint32_t at = 0;
  for (std::size_t b = 0; b < buckets; ++b) {
    bucket_begin[b] = at;
    for (std::size_t p = 0; p < pieces.size(); ++p) {
      const std::uint32_t count = offsets[p * buckets + b];
      offsets[p * buckets + b] = at;
      at += count;
    }
  }
  bucket_begin[buckets] = at;
  if (sorted.size() < total) sorted.resize(total);
  parallel_for(pieces.size(), [&](std::size_t p) {
    std::uint32_t* next = offsets.data() + p * buckets;
    for (const SparseTap& tap : pieces[p]) sorted[next[bucket_of(tap.entry)]++] = tap;
  });
}

SparseAdam::SparseAdam(std::int64_t entries, int features, const AdamOptions& options)
    : impl_(std::make_unique<Impl>(entries, features, options)) {
  assert(entries >= 0 && features > 0);
}
SparseAdam::~SparseAdam() = default;
SparseAdam::SparseAdam(SparseAdam&&) noexcept = default;
SparseAdam& SparseAdam::operator=(SparseAdam&&) noexcept = default;

SparseAdam::Result SparseAdam::step(std::span<float> table, std::span<const std::span<const SparseTap>> blocks,
                                    std::span<const float> upstream, double rate) {
  Impl& s = *impl_;
  assert(table.size() == s.entries * s.features);
  ++s.global_count;
  std::size_t taps = 0;
  for (const auto& block : blocks) taps += block.size();

  SparseAdamView view;
  view.features = s.features;
  view.table = table.data();
  view.moments = s.moments.data();
  view.counts = s.counts.data();
  view.upstream = upstream.data();
  view.constants = adam_constants(s.options.beta1, s.options.beta2, s.options.epsilon);
  view.corrections = s.corrections.data();
  view.last_correction = s.corrections.size() - 1;
  view.rate = static_cast<float>(rate);

  std::size_t buckets = 0;
  std::vector<SparseAdamCounts> counts;
  if (s.dense) {
    // Consecutive entries, few enough buckets for the sort and few enough entries for the cache.
    const std::size_t range = std::bit_ceil(std::max<std::size_t>(1024, s.entries / 4096));
    const int shift = std::countr_zero(range);
    buckets = (s.entries + range - 1) / range;
    counts.resize(buckets);
    s.sort(blocks, buckets, [shift](std::uint32_t entry) { return entry >> shift; });
    const AdamCorrection correction =
        adam_correction(s.options.beta1, s.options.beta2, static_cast<double>(s.global_count));
    parallel_for(buckets, [&](std::size_t b) {
      const std::span<const SparseTap> mine(s.sorted.data() + s.bucket_begin[b],
                                            s.bucket_begin[b + 1] - s.bucket_begin[b]);
      counts[b] =
          adam_range_kernel(view, mine, b * range, std::min(range, s.entries - b * range), correction, task_scratch());
    });
  } else {
    // Neighbouring entries (vertices of one triangle share cache lines) stay together; beyond that, hashing makes the
    // buckets equally full although some levels get far more contributions an entry than others.
    buckets = std::clamp<std::size_t>(std::bit_ceil(taps / 1024 + 1), 2, 4096);
    const int shift = 32 - std::countr_zero(buckets);
    counts.resize(buckets);
    s.sort(blocks, buckets, [shift](std::uint32_t entry) { return ((entry >> 4) * 2246822519u) >> shift; });
    parallel_for(buckets, [&](std::size_t b) {
      const std::span<const SparseTap> mine(s.sorted.data() + s.bucket_begin[b],
                                            s.bucket_begin[b + 1] - s.bucket_begin[b]);
      if (!mine.empty()) counts[b] = adam_sparse_kernel(view, mine, task_scratch());
    });
  }
  Result result;
  for (const SparseAdamCounts& c : counts) {
    result.touched += c.touched;
    result.non_finite += c.non_finite;
  }
  return result;
}

void SparseAdam::set_dense(bool dense) { impl_->dense = dense; }
std::span<float> SparseAdam::moments() { return impl_->moments.span(); }
std::span<std::uint16_t> SparseAdam::counts() { return impl_->counts.span(); }
std::int64_t& SparseAdam::global_count() { return impl_->global_count; }

std::int64_t SparseAdam::bytes(std::int64_t entries, int features) {
  return entries *
         (2 * features * static_cast<std::int64_t>(sizeof(float)) + static_cast<std::int64_t>(sizeof(std::uint16_t)));
}

}  // namespace octrad
