// Sorting, scans and sums on a stream. Memory is taken when a workspace is made, so that all of it may be recorded in a
// graph. Counts are known to the host: a queue that is not full is padded with keys that sort last.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

#include "octrad/device/array.h"

namespace octrad {

// Memory for any function below, for up to `capacity` items. One call at a time uses it.
class SortWorkspace {
 public:
  SortWorkspace() = default;
  SortWorkspace(Stream& stream, std::size_t capacity, const std::string& what);
  std::size_t capacity() const { return capacity_; }
  std::size_t bytes() const { return memory_.bytes(); }
  unsigned char* data() const { return memory_.data(); }

 private:
  std::size_t capacity_ = 0;
  DeviceArray<unsigned char> memory_;
};

// Pairs in rising order of the low `bits` bits (1 to 32) of their key, which alone are looked at; equal keys keep their
// order. The inputs stay as they are and must not overlap the outputs. n <= workspace.capacity(), else DeviceError.
void sort_pairs(Stream& stream, const SortWorkspace& workspace, std::size_t n, const std::uint32_t* keys_in,
                std::uint32_t* keys_out, const std::uint32_t* values_in, std::uint32_t* values_out, int bits = 32);

// out[i] = in[0] + ... + in[i - 1] modulo 2^32. out may be in.
void exclusive_sum(Stream& stream, const SortWorkspace& workspace, std::size_t n, const std::uint32_t* in,
                   std::uint32_t* out);

// *out = sum of in[0 .. n). The order of the additions depends on n and the device only, so that a run repeats bit for
// bit.
void sum(Stream& stream, const SortWorkspace& workspace, std::size_t n, const float* in, float* out);

}  // namespace octrad
