// Marks functions that run on the host and, when nvcc compiles them, on the device.
#pragma once

#if defined(__CUDACC__)
#define OCTRAD_HD __host__ __device__
#else
#define OCTRAD_HD
#endif
