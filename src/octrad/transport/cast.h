// cast(stream, n, functor): rays through the tree of a scene, for files named *_device.cc. As launch (device/launch.h),
// but lanes of a warp that are done take new rays before the others are, so that short rays do not wait for the longest
// one. Aila & Laine 2009, "Understanding the Efficiency of Ray Traversal on GPUs", with and without a queue that warps
// share.
// The host emulates warps, lane by lane.
//
// A functor is a Kernel with
//   static constexpr bool kAny;                    // any hit will do (occlusion), else the nearest
//   Bvh8View bvh() const;
//   std::uint32_t size() const;                    // rays: a number in the stream's memory, at most n
//   void count() const;                            // called once a launch, to count rays
//   RayQuery ray(std::uint32_t i) const;
//   void met(std::uint32_t i, const Hit&) const;   // takes the result; kAny: void met(std::uint32_t i, bool) const
#pragma once

#include <algorithm>
#include <cstdint>
#include <string>
#include <typeinfo>

#include "octrad/device/launch.h"
#include "octrad/geometry/bvh8_math.h"
#include "octrad/geometry/hit.h"

namespace octrad {
namespace cast_detail {

inline constexpr std::uint32_t kWarp = 32, kNone = 0xffffffffu;

template <typename F>
OCTRAD_HD inline void report(const F& f, const Bvh8Traversal<F::kAny>& traversal,
                             const typename Bvh8Traversal<F::kAny>::Memory& memory, std::uint32_t item) {
  if constexpr (F::kAny) {
    f.met(item, traversal.met());
  } else {
    f.met(item, traversal.hit(f.bvh(), memory));
  }
}

// Traces rays [next, last) with one warp, new ones when `refill` lanes are done. each(body): body(lane, traversal,
// memory, item) for every lane; vote(test): mask of the lanes for whose traversal the test holds. `taken`: where warps
// share the rays, how many have been taken; take(taken, n) takes n more.
OCTRAD_HD_OR_HOST
template <typename F, typename Warp>
OCTRAD_HD inline void cast_share(const F& f, Warp& warp, std::uint32_t refill, std::uint32_t* taken, std::uint32_t next,
                                 std::uint32_t last) {
  using Traversal = Bvh8Traversal<F::kAny>;
  using Memory = typename Traversal::Memory;
  const Bvh8View bvh = f.bvh();
  for (;;) {
    unsigned active = warp.vote([](const Traversal& traversal) { return traversal.active(); });
    const std::uint32_t free = kWarp - count_bits(active);
    if (active == 0 || (next < last && free >= refill)) {
      const bool more = next < last;
      if (taken != nullptr && more) next = warp.take(taken, free);
      warp.each([&](std::uint32_t lane, Traversal& traversal, Memory& memory, std::uint32_t& item) {
        if (traversal.active()) return;
        if (item != kNone) report(f, traversal, memory, item);
        const std::uint32_t place = next + count_bits(~active & ((1u << lane) - 1u));
        item = kNone;
        if (place >= last) return;
        item = place;
        const RayQuery ray = f.ray(place);
        traversal.begin(bvh, memory, ray.origin, ray.direction, 0.0f, ray.t_max);
      });
      if (!more) return;
      next = next < last && last - next > free ? next + free : last;
      active = warp.vote([](const Traversal& traversal) { return traversal.active(); });
    }
    warp.each([&](std::uint32_t, Traversal& traversal, Memory& memory, std::uint32_t&) {
      if (traversal.has_nodes() && !traversal.has_primitives()) traversal.visit(bvh, memory);
    });
    // Primitives are tested when at least half of the active lanes have some; until then other lanes visit nodes.
    for (;;) {
      const std::uint32_t waiting =
          count_bits(warp.vote([](const Traversal& traversal) { return traversal.has_primitives(); }));
      if (waiting == 0 || 2 * waiting < count_bits(active)) break;
      warp.each([&](std::uint32_t, Traversal& traversal, Memory& memory, std::uint32_t&) {
        if (traversal.has_primitives()) traversal.test(bvh, memory);
      });
    }
  }
}

// The consecutive rays of one of `warps` warps, a multiple of 32 of the `size` rays.
struct Share {
  std::uint32_t first, last;
};
OCTRAD_HD inline Share share_of(std::uint32_t warp, std::uint32_t warps, std::uint32_t size) {
  const std::uint64_t most = ((size + warps - std::uint64_t{1}) / warps + kWarp - 1) / kWarp * kWarp,
                      first = warp * most, last = first + most;
  return {first < size ? static_cast<std::uint32_t>(first) : size,
          last < size ? static_cast<std::uint32_t>(last) : size};
}

// The Warp of cast_share(): all 32 lanes on the host, one lane on a device.
template <bool kAny>
struct EmulatedWarp {
  Bvh8Traversal<kAny> traversals[kWarp];
  typename Bvh8Traversal<kAny>::Memory memory[kWarp];
  std::uint32_t items[kWarp];
  EmulatedWarp() { std::fill_n(items, kWarp, kNone); }
  template <typename Test>
  unsigned vote(Test test) const {
    unsigned lanes = 0;
    for (std::uint32_t lane = 0; lane < kWarp; ++lane) lanes |= (test(traversals[lane]) ? 1u : 0u) << lane;
    return lanes;
  }
  static std::uint32_t take(std::uint32_t* taken, std::uint32_t n) { return atomic_add(taken, n); }
  template <typename Body>
  void each(Body body) {
    for (std::uint32_t lane = 0; lane < kWarp; ++lane) body(lane, traversals[lane], memory[lane], items[lane]);
  }
};

#if defined(__CUDACC__)
template <bool kAny>
struct WarpLane {
  typename Bvh8Traversal<kAny>::Memory* memory;
  Bvh8Traversal<kAny> traversal{};
  std::uint32_t item = kNone;
  template <typename Test>
  __device__ unsigned vote(Test test) const {
    return __ballot_sync(0xffffffffu, test(traversal));
  }
  __device__ static std::uint32_t take(std::uint32_t* taken, std::uint32_t n) {
    const std::uint32_t first = threadIdx.x % kWarp == 0 ? atomicAdd(taken, n) : 0;
    return __shfl_sync(0xffffffffu, first, 0);
  }
  template <typename Body>
  __device__ void each(Body body) {
    body(threadIdx.x % kWarp, traversal, *memory, item);
  }
};

// Threads on a multiprocessor: as many as fit with 64 registers each (72 where the assembler would spill otherwise),
// to hide the latency of the traversal's loads.
#if defined(__CUDA_ARCH__) && __CUDA_ARCH__ >= 1200
inline constexpr unsigned kResident = 896;
#else
inline constexpr unsigned kResident = 1024;
#endif

template <typename F>
__global__ void __launch_bounds__(F::kBlock, kResident / F::kBlock)
    cast_kernel(std::uint32_t warps, std::uint32_t refill, std::uint32_t* taken, F f) {
  const std::uint32_t warp = (blockIdx.x * F::kBlock + threadIdx.x) / kWarp;
  if (blockIdx.x == 0 && threadIdx.x == 0) f.count();
  const Share share = taken != nullptr ? Share{0, f.size()} : share_of(warp, warps, f.size());
  if (share.first == share.last) return;
  typename Bvh8Traversal<F::kAny>::Memory memory;
  WarpLane<F::kAny> lanes{&memory};
  cast_share(f, lanes, refill, taken, share.first, share.last);
}
#endif

}  // namespace cast_detail

// `taken`: a number in the stream's memory that is 0 when the launch begins. With it and cast_dynamic, warps take rays
// from all that are left, so that no warp ends long after the others; else each has its share.
template <typename F>
void cast(Stream& stream, std::size_t n, const F& functor, std::uint32_t* taken = nullptr) {
  using cast_detail::EmulatedWarp, cast_detail::Share, cast_detail::cast_share, cast_detail::kWarp,
      cast_detail::share_of;
  static_assert(std::is_trivially_copyable_v<F> && !std::is_polymorphic_v<F>);
  static_assert(sizeof(F) <= kMostArguments && alignof(F) <= 16);
  static_assert(F::kBlock % kWarp == 0 && F::kBlock >= kWarp && F::kBlock <= 1024);
  if (n == 0) return;
  if (n > kMostItems)
    throw DeviceError("a launch of " + std::to_string(n) + " rays; " + std::to_string(kMostItems) + " are possible");
  // Many rays a lane keep lanes busy; too many leave parts of the device without work.
  const DeviceTuning& tuning = stream.tuning;
  const auto most = static_cast<std::uint32_t>((n + kWarp - 1) / kWarp),
             refill = static_cast<std::uint32_t>(tuning.cast_refill);
  if (!tuning.cast_dynamic) taken = nullptr;
  const auto least = static_cast<std::uint32_t>(tuning.cast_warps),
             warps = std::min(most, taken != nullptr
                                        ? least
                                        : std::max(least, most / static_cast<std::uint32_t>(tuning.cast_share)));
#if defined(__CUDACC__)
  if (stream.on_device()) {
    const std::uint32_t blocks = (warps * kWarp + F::kBlock - 1) / F::kBlock;
    cast_detail::cast_kernel<F>
        <<<blocks, F::kBlock, 0, cuda_handle(stream)>>>(blocks * (F::kBlock / kWarp), refill, taken, functor);
    check_launch(stream, typeid(F).name());
    return;
  }
#endif
  host_launch(
      stream, warps, KernelId<F>::id,
      [functor, warps, refill, taken](std::size_t begin, std::size_t end) {
        for (std::size_t i = begin; i < end; ++i) {
          if (i == 0) functor.count();
          const Share share = taken != nullptr ? Share{0, functor.size()}
                                               : share_of(static_cast<std::uint32_t>(i), warps, functor.size());
          if (share.first == share.last) continue;
          EmulatedWarp<F::kAny> lanes;
          cast_share(functor, lanes, refill, taken, share.first, share.last);
        }
      },
      8);
}

}  // namespace octrad
