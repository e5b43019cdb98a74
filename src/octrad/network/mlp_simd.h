// The one kernel under the multi-layer perceptron: a small matrix product, chosen for the processor at run time.
#pragma once

#include <cstddef>

namespace octrad {

inline constexpr std::size_t kPanel = 16;  // columns of B and C are stored in panels of 16 floats on every processor

// C[r][c] = post(sum over k < depth, in order, of A(r, k) * B(k, c)) for r < rows and all columns of `panels` panels.
// Every element is one chain of fused multiply-adds over k (separate multiply and add where the processor has no FMA),
// whatever its place in the matrix: a row's result does not depend on the rows beside it.
struct GemmArgs {
  // Where the result of the sum goes. `masked`: kept where mask > 0, else 0 (the derivative of ReLU).
  // `accumulate`: the sum starts at C instead of 0.
  enum class Post { store, relu, masked, accumulate };

  std::size_t rows = 0, depth = 0, panels = 0;
  const float* a = nullptr;  // A(r, k) = a[r * a_stride + k], or a[k * a_stride + r] when a_transposed
  std::size_t a_stride = 0;
  bool a_transposed = false;
  const float* b = nullptr;  // B(k, 16 p + j) = b[p * b_panel + k * b_stride + j]
  std::size_t b_stride = kPanel, b_panel = 0;
  float* c = nullptr;  // C(r, 16 p + j) = c[r * c_stride + 16 p + j]
  std::size_t c_stride = 0;
  const float* mask = nullptr;  // same indexing as c
  std::size_t mask_stride = 0;
  Post post = Post::store;
};

void gemm(const GemmArgs& args);

// Name of the instruction set that gemm() and the Adam kernels use now, e.g. "AVX3" (AVX-512), "AVX2", "SSE4".
const char* network_simd_name();

}  // namespace octrad
