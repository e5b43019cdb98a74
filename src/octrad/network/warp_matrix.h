// The warps that the programs of mlp_program.h run on: registers and the matrix instruction. CudaWarp is one lane of a
// CUDA warp; HostWarp emulates all 32 lanes and the instruction, so that the same program runs on the host stream and
// in tests on machines without a GPU.
//
// Word: two halves a lane. Float: one float a lane. lanes(f) calls f(lane) for the lanes that this object holds;
// at(x, lane) is a lane's own value.
#pragma once

#include <cstdint>
#include <cstring>

#if defined(__CUDACC__)
#include <cuda_pipeline_primitives.h>
#endif

#include "octrad/base/half.h"
#include "octrad/network/mlp_fragment_math.h"

namespace octrad {

class HostWarp {
 public:
  struct Word {
    Vec2f v[kWarp];
  };  // halves, widened
  struct Float {
    float v[kWarp];
  };
  OCTRAD_HD explicit HostWarp(const std::uint32_t* weights = nullptr) : weights_(weights) {}

  OCTRAD_HD static float& at(Float& x, int lane) { return x.v[lane]; }
  template <typename F>
  OCTRAD_HD void lanes(F&& f) const {
    for (int lane = 0; lane < kWarp; ++lane) f(lane);
  }
  template <typename F>
  OCTRAD_HD Word words(F&& f) const {  // f(lane) -> two halves in a word
    Word w;
    for (int lane = 0; lane < kWarp; ++lane) w.v[lane] = unpack_halves(f(lane));
    return w;
  }
  OCTRAD_HD static void clear(Float (&c)[4]) { std::memset(&c, 0, sizeof(c)); }
  OCTRAD_HD static void clear(Word (&w)[4]) { std::memset(&w, 0, sizeof(w)); }

  OCTRAD_HD void load(const std::uint32_t* block, Word (&w)[4]) const {
    for (int lane = 0; lane < kWarp; ++lane) {
      for (int r = 0; r < 4; ++r) w[r].v[lane] = unpack_halves(block[lane * 4 + r]);
    }
  }
  OCTRAD_HD void store(std::uint32_t* block, const Word (&w)[4]) const {
    for (int lane = 0; lane < kWarp; ++lane) {
      for (int r = 0; r < 4; ++r) block[lane * 4 + r] = pack_halves(w[r].v[lane].x, w[r].v[lane].y);
    }
  }
  OCTRAD_HD void need_weights(int, int) const {}
  OCTRAD_HD void load_weights(int block, Word (&w)[4]) const {
    load(weights_ + static_cast<std::size_t>(block) * kBlockWords, w);
  }

  OCTRAD_HD static Word relu(const Float& low, const Float& high) {
    const auto one = [](float x) { return to_float(to_half(x < 0.0f ? 0.0f : (x > kLargestHalf ? kLargestHalf : x))); };
    Word w;
    for (int lane = 0; lane < kWarp; ++lane) w.v[lane] = {one(low.v[lane]), one(high.v[lane])};
    return w;
  }
  OCTRAD_HD static Word where_positive(const Float& low, const Float& high, const Word& h) {
    const auto one = [](float x) {
      return to_float(to_half(x < -kLargestHalf ? -kLargestHalf : (x > kLargestHalf ? kLargestHalf : x)));
    };
    Word w;
    for (int lane = 0; lane < kWarp; ++lane) {
      w.v[lane] = {h.v[lane].x > 0.0f ? one(low.v[lane]) : 0.0f, h.v[lane].y > 0.0f ? one(high.v[lane]) : 0.0f};
    }
    return w;
  }
  // The transpose of the 8 x 8 halves that a word of all lanes holds, row lane / 4, columns 2 (lane % 4) and the next.
  OCTRAD_HD static Word transpose(const Word& a) {
    Word w;
    for (int lane = 0; lane < kWarp; ++lane) {
      const int row = lane % 4 * 2, col = lane / 4;
      const auto half = [&](int r, int c) { return c % 2 == 0 ? a.v[r * 4 + c / 2].x : a.v[r * 4 + c / 2].y; };
      w.v[lane] = {half(row, col), half(row + 1, col)};
    }
    return w;
  }
  OCTRAD_HD static void mma(Float (&c)[4], const Word (&a)[4], const Word& b0, const Word& b1) {
    float left[16][16], right[16][8], sum[16][8];
    for (int lane = 0; lane < kWarp; ++lane) {
      for (int r = 0; r < 4; ++r) {
        float* at_a = &left[fragment_a_row(lane, r)][fragment_a_col(lane, r)];
        at_a[0] = a[r].v[lane].x;
        at_a[1] = a[r].v[lane].y;
        sum[fragment_c_row(lane, r)][fragment_c_col(lane, r)] = c[r].v[lane];
      }
      const int n = fragment_b_n(lane);
      right[fragment_b_k(lane, 0)][n] = b0.v[lane].x;
      right[fragment_b_k(lane, 0) + 1][n] = b0.v[lane].y;
      right[fragment_b_k(lane, 1)][n] = b1.v[lane].x;
      right[fragment_b_k(lane, 1) + 1][n] = b1.v[lane].y;
    }
    for (int i = 0; i < 16; ++i) {
      for (int k = 0; k < 16; ++k) {
        for (int n = 0; n < 8; ++n) sum[i][n] += left[i][k] * right[k][n];
      }
    }
    for (int lane = 0; lane < kWarp; ++lane) {
      for (int r = 0; r < 4; ++r) c[r].v[lane] = sum[fragment_c_row(lane, r)][fragment_c_col(lane, r)];
    }
  }

 private:
  const std::uint32_t* weights_;
};

#if defined(__CUDACC__)
// Blocks of weights are read from shared memory, which holds a window of them (all, where they fit).
class CudaWarp {
 public:
  using Word = std::uint32_t;
  using Float = float;
  OCTRAD_HD CudaWarp() = default;
  // shared: memory for window_blocks blocks. All threads of the block must run the same program.
  OCTRAD_HD CudaWarp(const std::uint32_t* weights, int blocks, std::uint32_t* shared, int window_blocks)
      : weights_(weights),
        shared_(shared),
        blocks_(blocks),
        window_(window_blocks),
        first_(-window_blocks) {}

  OCTRAD_HD static float& at(Float& x, int) { return x; }
  template <typename F>
  OCTRAD_HD void lanes(F&& f) const {
    f(lane());
  }
  template <typename F>
  OCTRAD_HD Word words(F&& f) const {
    return f(lane());
  }
  OCTRAD_HD static void clear(Float (&c)[4]) { c[0] = c[1] = c[2] = c[3] = 0.0f; }
  OCTRAD_HD static void clear(Word (&w)[4]) { w[0] = w[1] = w[2] = w[3] = 0u; }

  // From memory that the kernel does not write: loads need not wait for stores before them.
  OCTRAD_HD void load([[maybe_unused]] const std::uint32_t* block, [[maybe_unused]] Word (&w)[4]) const {
#if defined(__CUDA_ARCH__)
    take(__ldg(reinterpret_cast<const uint4*>(block + lane() * 4)), w);
#endif
  }
  OCTRAD_HD void store(std::uint32_t* block, const Word (&w)[4]) const {
    *reinterpret_cast<uint4*>(block + lane() * 4) = make_uint4(w[0], w[1], w[2], w[3]);
  }
  // Blocks first .. first + count - 1 are used next (count <= window).
  OCTRAD_HD void need_weights([[maybe_unused]] int first, [[maybe_unused]] int count) {
#if defined(__CUDA_ARCH__)
    if (first >= first_ && first + count <= first_ + window_) return;
    __syncthreads();
    first_ = first;
    const int have = blocks_ - first < window_ ? blocks_ - first : window_;
    const auto* from = reinterpret_cast<const uint4*>(weights_ + static_cast<std::size_t>(first) * kBlockWords);
    auto* to = reinterpret_cast<uint4*>(shared_);
    for (int i = static_cast<int>(threadIdx.x); i < have * kWarp; i += static_cast<int>(blockDim.x))
      __pipeline_memcpy_async(to + i, from + i, sizeof(uint4));
    __pipeline_commit();
    __pipeline_wait_prior(0);
    __syncthreads();
#endif
  }
  OCTRAD_HD void load_weights(int block, Word (&w)[4]) const {
    take(*reinterpret_cast<const uint4*>(shared_ + (block - first_) * kBlockWords + lane() * 4), w);
  }

  OCTRAD_HD static Word relu(Float low, Float high) {
#if defined(__CUDA_ARCH__) && __CUDA_ARCH__ >= 800
    Word w;
    asm("cvt.rn.relu.satfinite.f16x2.f32 %0, %1, %2;" : "=r"(w) : "f"(high), "f"(low));  // NaN stays
    return w;
#else
    const auto one = [](float x) { return x < 0.0f ? 0.0f : (x > kLargestHalf ? kLargestHalf : x); };
    return pack_halves(one(low), one(high));
#endif
  }
  OCTRAD_HD static Word where_positive(Float low, Float high, Word h) {
#if defined(__CUDA_ARCH__)
    Word word;
#if __CUDA_ARCH__ >= 800
    asm("cvt.rn.satfinite.f16x2.f32 %0, %1, %2;" : "=r"(word) : "f"(high), "f"(low));  // NaN stays
#else
    const auto one = [](float x) { return x < -kLargestHalf ? -kLargestHalf : (x > kLargestHalf ? kLargestHalf : x); };
    word = pack_halves(one(low), one(high));
#endif
    __half2 mask;
    memcpy(&mask, &h, sizeof(mask));
    return word & __hgt2_mask(mask, __half2half2(__ushort_as_half(0)));
#else
    return pack_halves(low, high) & h;  // never run
#endif
  }
  // Warp-wide instructions are volatile: the compiler must not move them into a branch that only some lanes take.
  OCTRAD_HD static Word transpose(Word a) {
#if defined(__CUDA_ARCH__)
    Word w;
    asm volatile("movmatrix.sync.aligned.m8n8.trans.b16 %0, %1;" : "=r"(w) : "r"(a));
    return w;
#else
    return a;                           // never run
#endif
  }
  OCTRAD_HD static void mma([[maybe_unused]] Float (&c)[4], [[maybe_unused]] const Word (&a)[4],
                            [[maybe_unused]] Word b0, [[maybe_unused]] Word b1) {
#if defined(__CUDA_ARCH__) && __CUDA_ARCH__ >= 800
    asm volatile(
        "mma.sync.aligned.m16n8k16.row.col.f32.f16.f16.f32 {%0, %1, %2, %3}, {%4, %5, %6, %7}, {%8, %9}, {%0, %1, %2, %3};"
        : "+f"(c[0]), "+f"(c[1]), "+f"(c[2]), "+f"(c[3])
        : "r"(a[0]), "r"(a[1]), "r"(a[2]), "r"(a[3]), "r"(b0), "r"(b1));
#elif defined(__CUDA_ARCH__)
    asm volatile("mma.sync.aligned.m16n8k8.row.col.f32.f16.f16.f32 {%0, %1, %2, %3}, {%4, %5}, {%6}, {%0, %1, %2, %3};"
                 : "+f"(c[0]), "+f"(c[1]), "+f"(c[2]), "+f"(c[3])
                 : "r"(a[0]), "r"(a[1]), "r"(b0));
    asm volatile("mma.sync.aligned.m16n8k8.row.col.f32.f16.f16.f32 {%0, %1, %2, %3}, {%4, %5}, {%6}, {%0, %1, %2, %3};"
                 : "+f"(c[0]), "+f"(c[1]), "+f"(c[2]), "+f"(c[3])
                 : "r"(a[2]), "r"(a[3]), "r"(b1));
#endif
  }

 private:
  OCTRAD_HD static int lane() {
#if defined(__CUDA_ARCH__)
    return static_cast<int>(threadIdx.x & 31u);
#else
    return 0;
#endif
  }
  OCTRAD_HD static void take(uint4 v, Word (&w)[4]) {
    w[0] = v.x;
    w[1] = v.y;
    w[2] = v.z;
    w[3] = v.w;
  }

  const std::uint32_t* weights_ = nullptr;
  std::uint32_t* shared_ = nullptr;
  int blocks_ = 0, window_ = 0, first_ = 0;
};
#endif

}  // namespace octrad
