// launch(stream, n, functor): functor(i) for i = 0 .. n - 1, in any order, from many threads; launch_levels: the same
// for each of several levels; launch_parts: several functors of a kind in one launch. For files named *_device.cc: they
// compile as CUDA where octrad is built with it, and as plain C++ otherwise; both run on the host stream.
//
// A functor is a trivially copyable struct with `OCTRAD_HD void operator()(std::uint32_t i) const`; pointers in it
// point to memory of the stream. Items that write to the same place use atomic_add or atomic_append below.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <type_traits>
#include <typeinfo>

#include "octrad/base/error.h"
#include "octrad/base/hd.h"
#include "octrad/device/host_stream.h"
#include "octrad/device/stream.h"
#if defined(__CUDACC__)
#include "octrad/device/cuda_stream.h"
#endif

namespace octrad {

#if defined(__CUDACC__)
template <typename F>
__global__ void __launch_bounds__(F::kBlock, F::kMinBlocks) launch_kernel(std::uint32_t n, F f) {
  const std::uint32_t i = blockIdx.x * blockDim.x + threadIdx.x;
  if (i < n) f(i);
}
template <typename F>
__global__ void __launch_bounds__(F::kBlock, F::kMinBlocks) launch_levels_kernel(std::uint32_t n, F f) {
  const std::uint32_t i = blockIdx.x * blockDim.x + threadIdx.x;
  if (i < n) f(blockIdx.y, i);
}
#endif

// Functors derive from this; other numbers shadow these.
struct Kernel {
  static constexpr unsigned kBlock = 128;
  // Blocks that must fit on a multiprocessor; 0: the assembler decides, and may spill.
  static constexpr unsigned kMinBlocks = 0;
};

// Arguments of a kernel that every driver and device takes, less the count; larger tables belong into memory of the
// stream.
inline constexpr std::size_t kMostArguments = 4096 - 16;
// Items are numbered in 32 bits, and the last block must not wrap around.
inline constexpr std::size_t kMostItems = 0xffffffffu - 1023u;

template <typename F>
void check_launch_of(std::size_t n) {
  static_assert(std::is_trivially_copyable_v<F> && !std::is_polymorphic_v<F>);
  static_assert(sizeof(F) <= kMostArguments && alignof(F) <= 16);
  static_assert(F::kBlock % 32 == 0 && F::kBlock >= 32 && F::kBlock <= 1024);
  if (n > kMostItems)
    throw DeviceError("a launch of " + std::to_string(n) + " items; " + std::to_string(kMostItems) + " are possible");
}

// Threads of a block.
template <typename F>
unsigned block_of(const Stream& stream) {
  const auto wanted = static_cast<unsigned>(stream.tuning.block);
  return wanted > 0 && wanted < F::kBlock ? wanted : F::kBlock;
}

template <typename F>
void launch(Stream& stream, std::size_t n, const F& functor) {
  check_launch_of<F>(n);
  if (n == 0) return;
#if defined(__CUDACC__)
  if (stream.on_device()) {
    const auto count = static_cast<std::uint32_t>(n);
    const unsigned block = block_of<F>(stream);
    launch_kernel<F><<<(count + block - 1) / block, block, 0, cuda_handle(stream)>>>(count, functor);
    check_launch(stream, typeid(F).name());
    return;
  }
#endif
  host_launch(stream, n, KernelId<F>::id, [functor](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) functor(static_cast<std::uint32_t>(i));
  });
}

// functor(level, i) for level = 0 .. levels - 1 and i = 0 .. n - 1. On a device all threads of a block have one level,
// so that what depends on it alone is read once for all of them, and blocks of a level start before those of the next
// one.
template <typename F>
void launch_levels(Stream& stream, std::size_t n, int levels, const F& functor) {
  check_launch_of<F>(n);
  if (n == 0 || levels <= 0) return;
#if defined(__CUDACC__)
  if (stream.on_device()) {
    const auto count = static_cast<std::uint32_t>(n);
    const unsigned block = block_of<F>(stream);
    const dim3 blocks((count + block - 1) / block, static_cast<unsigned>(levels));
    launch_levels_kernel<F><<<blocks, block, 0, cuda_handle(stream)>>>(count, functor);
    check_launch(stream, typeid(F).name());
    return;
  }
#endif
  host_launch(stream, n * static_cast<std::size_t>(levels), KernelId<F>::id,
              [functor, n](std::size_t begin, std::size_t end) {
                for (std::size_t i = begin; i < end; ++i)
                  functor(static_cast<std::uint32_t>(i / n), static_cast<std::uint32_t>(i % n));
              });
}

// A functor and its number of items.
template <typename F>
struct LaunchPart {
  std::size_t n;
  F functor;
};
// Items of several parts, one part's after the other's.
template <typename F, std::size_t kParts>
struct LaunchedParts : Kernel {
  static constexpr unsigned kBlock = F::kBlock;
  static constexpr unsigned kMinBlocks = F::kMinBlocks;
  std::uint32_t n[kParts];
  F functors[kParts];

  OCTRAD_HD void operator()(std::uint32_t i) const {
    std::uint32_t part = 0;
    while (i >= n[part]) i -= n[part++];
    functors[part](i);
  }
};

// Every part's functor(i) for i = 0 .. n - 1, all of them in any order, in one launch for up to eight parts: for small
// kernels, of which a launch takes longer than the work.
template <typename F>
void launch_parts(Stream& stream, const LaunchPart<F>* parts, std::size_t count) {
  constexpr std::size_t kParts = 8;
  for (std::size_t first = 0; first < count; first += kParts) {
    LaunchedParts<F, kParts> some{};
    std::size_t items = 0;
    for (std::size_t k = 0; k < kParts && first + k < count; ++k) {
      const LaunchPart<F>& part = parts[first + k];
      check_launch_of<F>(part.n);
      some.n[k] = static_cast<std::uint32_t>(part.n);
      some.functors[k] = part.functor;
      items += part.n;
    }
    launch(stream, items, some);
  }
}

// Adds and returns the old value. Sums of floats depend on the order in which items come.
template <typename T>
OCTRAD_HD inline T atomic_add(T* at, T value) {
#if defined(__CUDA_ARCH__)
  return atomicAdd(at, value);
#else
  if constexpr (std::is_integral_v<T>) {
    return __atomic_fetch_add(at, value, __ATOMIC_RELAXED);
  } else {
    T old;
    __atomic_load(at, &old, __ATOMIC_RELAXED);
    T sum = old + value;
    while (!__atomic_compare_exchange(at, &old, &sum, true, __ATOMIC_RELAXED, __ATOMIC_RELAXED)) sum = old + value;
    return old;
  }
#endif
}

// Appends to a list of *count items: returns the index of the new one. Lanes of a warp that call it together share one
// atomic operation.
OCTRAD_HD inline std::uint32_t atomic_append(std::uint32_t* count) {
#if defined(__CUDA_ARCH__)
  const unsigned lanes = __activemask();
  unsigned lane;
  asm("mov.u32 %0, %%laneid;" : "=r"(lane));
  const int leader = __ffs(static_cast<int>(lanes)) - 1;
  unsigned base = 0;
  if (static_cast<int>(lane) == leader) base = atomicAdd(count, static_cast<unsigned>(__popc(lanes)));
  return __shfl_sync(lanes, base, leader) + static_cast<unsigned>(__popc(lanes & ((1u << lane) - 1u)));
#else
  return atomic_add(count, std::uint32_t{1});
#endif
}

// The same for `items` new ones of each caller: the index of its first. On a device the lanes of a warp that call it
// together must be the first ones, as in kernels of one item a thread.
OCTRAD_HD inline std::uint32_t atomic_append_many(std::uint32_t* count, std::uint32_t items) {
#if defined(__CUDA_ARCH__)
  const unsigned lanes = __activemask();
  const int last = __popc(lanes) - 1;
  unsigned lane, before = items;
  asm("mov.u32 %0, %%laneid;" : "=r"(lane));
  for (unsigned step = 1; step < 32; step *= 2) {
    const unsigned other = __shfl_up_sync(lanes, before, step);
    if (lane >= step) before += other;
  }
  unsigned base = 0;
  if (static_cast<int>(lane) == last && before > 0) base = atomicAdd(count, before);
  return __shfl_sync(lanes, base, last) + before - items;
#else
  return items > 0 ? atomic_add(count, items) : 0;
#endif
}

// Loads and stores of words that other items load or store in the same launch. On a GPU they are plain ones.
OCTRAD_HD inline std::uint32_t relaxed_load(const std::uint32_t* at) {
#if defined(__CUDA_ARCH__)
  return *at;
#else
  return __atomic_load_n(at, __ATOMIC_RELAXED);
#endif
}
OCTRAD_HD inline void relaxed_store(std::uint32_t* at, std::uint32_t value) {
#if defined(__CUDA_ARCH__)
  *at = value;
#else
  __atomic_store_n(at, value, __ATOMIC_RELAXED);
#endif
}

// *at becomes the larger of the two; `at` is the same for all items. Most of them have a smaller value, and only look.
OCTRAD_HD inline void atomic_max(std::uint32_t* at, std::uint32_t value) {
#if defined(__CUDA_ARCH__)
  if (value <= *static_cast<volatile std::uint32_t*>(at)) return;
#if __CUDA_ARCH__ >= 800
  // Active lanes of a warp share one atomic operation: at first every lane has a new maximum.
  const unsigned lanes = __activemask();
  value = __reduce_max_sync(lanes, value);
  if ((lanes & ((1u << (threadIdx.x & 31u)) - 1u)) != 0) return;
#endif
  atomicMax(at, value);
#else
  std::uint32_t old = __atomic_load_n(at, __ATOMIC_RELAXED);
  while (value > old && !__atomic_compare_exchange_n(at, &old, value, true, __ATOMIC_RELAXED, __ATOMIC_RELAXED)) {
  }
#endif
}

OCTRAD_HD inline std::uint32_t atomic_or(std::uint32_t* at, std::uint32_t bits) {
#if defined(__CUDA_ARCH__)
  return atomicOr(at, bits);
#else
  return __atomic_fetch_or(at, bits, __ATOMIC_RELAXED);
#endif
}

}  // namespace octrad
