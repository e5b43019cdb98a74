// What launch.h and kernels need of the CUDA stream. Only for files that nvcc compiles.
#pragma once

#include <cuda_runtime.h>

#include "octrad/device/stream.h"

namespace octrad {

cudaStream_t cuda_handle(Stream& stream);
// Throws DeviceError if the last launch was refused.
void check_launch(Stream& stream);
// Throws DeviceError, or MemoryError for cudaErrorMemoryAllocation, saying what was being done.
void check_cuda(cudaError_t status, const char* what);

}  // namespace octrad
