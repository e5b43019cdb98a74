// What launch.h and kernels need of the CUDA stream. Only for files that nvcc compiles.
#pragma once

#include <cuda_runtime.h>

#include "octrad/device/stream.h"

namespace octrad {

cudaStream_t cuda_handle(Stream& stream);
// Throws DeviceError, naming the `kernel` (or typeid(F).name() of its functor), if its launch was refused. With the
// environment variable OCTRAD_CUDA_SYNC it waits for each kernel outside of recorded graphs, so that what goes wrong in
// one is reported there and not by a later call.
void check_launch(Stream& stream, const char* kernel);
// Throws DeviceError, or MemoryError for cudaErrorMemoryAllocation, saying what was being done.
void check_cuda(cudaError_t status, const char* what);

}  // namespace octrad
