// The functions of the CUDA toolkit's CUB that sort.cc uses. Only sort_cub.cu includes CUB: it is slow to compile.
#pragma once

#include <cstddef>
#include <cstdint>

#include "octrad/device/stream.h"

namespace octrad {

// Bytes that the functions below need for up to n items.
std::size_t cub_workspace_bytes(Stream& stream, std::size_t n);
void cub_sort_pairs(Stream& stream, void* workspace, std::size_t bytes, std::size_t n, const std::uint32_t* keys_in,
                    std::uint32_t* keys_out, const std::uint32_t* values_in, std::uint32_t* values_out, int bits);
void cub_exclusive_sum(Stream& stream, void* workspace, std::size_t bytes, std::size_t n, const std::uint32_t* in,
                       std::uint32_t* out);
void cub_sum(Stream& stream, void* workspace, std::size_t bytes, std::size_t n, const float* in, float* out);

}  // namespace octrad
