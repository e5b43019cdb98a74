// Marks functions that run on the host and, when nvcc compiles them, on the device.
#pragma once

#if defined(__CUDACC__)
#define OCTRAD_HD __host__ __device__
#else
#define OCTRAD_HD
#endif

// Before a loop of constant length whose arrays must stay in registers.
#if defined(__CUDA_ARCH__)
#define OCTRAD_UNROLL _Pragma("unroll")
#else
#define OCTRAD_UNROLL
#endif

// Before an OCTRAD_HD template whose arguments may also be types of the host alone.
#if defined(__CUDACC__)
#define OCTRAD_HD_OR_HOST _Pragma("nv_exec_check_disable")
#else
#define OCTRAD_HD_OR_HOST
#endif

// A function that is not inlined: rare, large, and called from code that must stay small or, on a device, must not hold
// its registers for it. Its parameters are values: an address would force the caller's variable into memory.
#if defined(__CUDACC__)
#define OCTRAD_HD_APART __host__ __device__ __noinline__
#else
#define OCTRAD_HD_APART __attribute__((noinline))
#endif

// The same on devices, where kernels that call it more than once hold its code once; inlined on the host.
#if defined(__CUDA_ARCH__)
#define OCTRAD_HD_APART_ON_DEVICE __host__ __device__ __noinline__
#else
#define OCTRAD_HD_APART_ON_DEVICE OCTRAD_HD
#endif
