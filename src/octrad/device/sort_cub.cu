#include "octrad/device/sort_cub.h"

#include <algorithm>
#include <cub/device/device_radix_sort.cuh>
#include <cub/device/device_reduce.cuh>
#include <cub/device/device_scan.cuh>

#include "octrad/device/cuda_stream.h"

namespace octrad {

std::size_t cub_workspace_bytes(Stream& stream, std::size_t n) {
  cuda_handle(stream);  // CUB asks the current device
  const std::uint32_t* in = nullptr;
  std::uint32_t* out = nullptr;
  const float* floats_in = nullptr;
  float* floats_out = nullptr;
  std::size_t pairs = 0, scan = 0, reduce = 0;
  check_cuda(cub::DeviceRadixSort::SortPairs(nullptr, pairs, in, out, in, out, n), "sizing a sort");
  check_cuda(cub::DeviceScan::ExclusiveSum(nullptr, scan, in, out, n), "sizing a scan");
  check_cuda(cub::DeviceReduce::Sum(nullptr, reduce, floats_in, floats_out, n), "sizing a sum");
  return std::max({pairs, scan, reduce});
}

void cub_sort_pairs(Stream& stream, void* workspace, std::size_t bytes, std::size_t n, const std::uint32_t* keys_in,
                    std::uint32_t* keys_out, const std::uint32_t* values_in, std::uint32_t* values_out, int bits) {
  check_cuda(cub::DeviceRadixSort::SortPairs(workspace, bytes, keys_in, keys_out, values_in, values_out, n, 0, bits,
                                             cuda_handle(stream)),
             "sorting");
}

void cub_exclusive_sum(Stream& stream, void* workspace, std::size_t bytes, std::size_t n, const std::uint32_t* in,
                       std::uint32_t* out) {
  check_cuda(cub::DeviceScan::ExclusiveSum(workspace, bytes, in, out, n, cuda_handle(stream)), "scanning");
}

void cub_sum(Stream& stream, void* workspace, std::size_t bytes, std::size_t n, const float* in, float* out) {
  check_cuda(cub::DeviceReduce::Sum(workspace, bytes, in, out, n, cuda_handle(stream)), "summing");
}

}  // namespace octrad
