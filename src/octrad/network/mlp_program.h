// The multi-layer perceptron as a program of one warp: a tile of rows goes through all layers in registers (their
// layout is in mlp_fragment_math.h). Written for any Warp of warp_matrix.h. The same program takes gradients from the
// outputs back to the inputs: the layers in reverse order with transposed weights, and the derivative of ReLU in place
// of ReLU.
#pragma once

#include "octrad/network/warp_matrix.h"

namespace octrad {

// The inputs of the first layer: features of rows, zeros beyond `count` features and n rows; halves, or floats that are
// scaled and rounded. kBatch: operands whose loads are in flight together where registers allow it.
struct HalfInput {
  static constexpr int kBatch = 3;
  HalfRows rows;
  int count = 0;
  std::uint32_t n = 0;

  OCTRAD_HD std::uint32_t word(std::size_t row, int col) const {  // col is even
    return row < n && col < count ? rows.data[static_cast<std::size_t>(col >> 1) * rows.stride + row] : 0u;
  }
};
struct ScaledInput {
  static constexpr int kBatch = 1;
  FloatRows rows;
  int count = 0;
  std::uint32_t n = 0;
  const float* scale = nullptr;

  OCTRAD_HD std::uint32_t word(std::size_t row, int col) const {
    return pack_halves(number(row, col) * *scale, number(row, col + 1) * *scale);
  }
  OCTRAD_HD float number(std::size_t row, int col) const {
    return row < n && col < count ? rows.data[static_cast<std::size_t>(col) * rows.stride + row] : 0.0f;
  }
};

// The 16 x 16 operand at rows row .. row + 15, features 16 k_tile ...
template <typename Warp, typename Input>
OCTRAD_HD inline void load_operand(const Warp& warp, const Input& input, std::size_t row, int k_tile,
                                   typename Warp::Word (&a)[4]) {
  OCTRAD_UNROLL
  for (int r = 0; r < 4; ++r) {
    a[r] = warp.words([&](int lane) {
      return input.word(row + static_cast<std::size_t>(fragment_a_row(lane, r)),
                        k_tile * kTile + fragment_a_col(lane, r));
    });
  }
}

// Kept hidden layers in memory: address of block t of hidden layer l, for the 16 rows of a tile.
struct KeptBlocks {
  std::uint32_t* data = nullptr;
  int hidden = 0, width = 0;

  OCTRAD_HD std::uint32_t* at(std::uint32_t tile, int l, int t) const {
    const std::uint32_t first =
        (tile * static_cast<std::uint32_t>(hidden) + static_cast<std::uint32_t>(l)) * static_cast<std::uint32_t>(width);
    return data + static_cast<std::size_t>(first) * kBlockWords + t * kBlockWords;
  }
};

// Forward: ReLU; kKeep: `kept` receives the activations.
template <bool kKeep>
struct ReluBetween {
  KeptBlocks kept;

  template <typename Warp>
  OCTRAD_HD void operator()(Warp& warp, std::uint32_t tile, int layer, int t, typename Warp::Float (&c0)[4],
                            typename Warp::Float (&c1)[4], typename Warp::Word (&h)[4]) const {
    h[0] = Warp::relu(c0[0], c0[1]);
    h[1] = Warp::relu(c0[2], c0[3]);
    h[2] = Warp::relu(c1[0], c1[1]);
    h[3] = Warp::relu(c1[2], c1[3]);
    if constexpr (kKeep) warp.store(kept.at(tile, layer, t), h);
  }
};
// Backward: layer 0 of the program is the last hidden one. Reads the activations, keeps the gradients.
struct MaskBetween {
  KeptBlocks activations, kept;

  template <typename Warp>
  OCTRAD_HD void operator()(Warp& warp, std::uint32_t tile, int layer, int t, typename Warp::Float (&c0)[4],
                            typename Warp::Float (&c1)[4], typename Warp::Word (&h)[4]) const {
    const int l = kept.hidden - 1 - layer;
    typename Warp::Word a[4];
    warp.load(activations.at(tile, l, t), a);
    h[0] = Warp::where_positive(c0[0], c0[1], a[0]);
    h[1] = Warp::where_positive(c0[2], c0[3], a[1]);
    h[2] = Warp::where_positive(c1[0], c1[1], a[2]);
    h[3] = Warp::where_positive(c1[2], c1[3], a[3]);
    warp.store(kept.at(tile, l, t), h);
  }
};

// kWidth blocks wide, kTall times 16 rows from row 16 kTall group on. out.ready()(row, column, value) for every output
// of every row < n; columns beyond the network's own are left out by `outputs`.
template <int kWidth, int kTall, typename Warp, typename Input, typename Between, typename Output>
OCTRAD_HD inline void run_mlp(Warp& warp, const MlpPlan& plan, const Input& input, const Between& between,
                              const Output& out, int outputs, std::uint32_t n, std::uint32_t group) {
  using Word = typename Warp::Word;
  using Float = typename Warp::Float;
  const std::uint32_t tile = group * kTall;
  const std::size_t row =
      static_cast<std::size_t>(tile) * kTile;  // 64 bits: constant offsets become part of the load instructions
  Word h[kTall][kWidth][4];
  {
    Float c[kTall][2 * kWidth][4];
    OCTRAD_UNROLL
    for (int m = 0; m < kTall; ++m) {
      OCTRAD_UNROLL
      for (int j = 0; j < 2 * kWidth; ++j) Warp::clear(c[m][j]);
    }
    constexpr int kBatch =
        kWidth < 8 ? Input::kBatch : 1;  // where the sums leave no registers for more, other warps hide the latency
    for (int first = 0; first < plan.in; first += kBatch) {
      Word a[kBatch][kTall][4];
      OCTRAD_UNROLL
      for (int s = 0; s < kBatch; ++s) {
        OCTRAD_UNROLL
        for (int m = 0; m < kTall; ++m)
          load_operand(warp, input, row + static_cast<std::size_t>(m * kTile), first + s, a[s][m]);
      }
      OCTRAD_UNROLL
      for (int s = 0; s < kBatch; ++s) {
        const int k = first + s;
        if (k >= plan.in) break;
        warp.need_weights(k * kWidth, kWidth);
        OCTRAD_UNROLL
        for (int j = 0; j < kWidth; ++j) {
          Word b[4];
          warp.load_weights(k * kWidth + j, b);
          OCTRAD_UNROLL
          for (int m = 0; m < kTall; ++m) {
            Warp::mma(c[m][2 * j], a[s][m], b[0], b[1]);
            Warp::mma(c[m][2 * j + 1], a[s][m], b[2], b[3]);
          }
        }
      }
    }
    OCTRAD_UNROLL
    for (int m = 0; m < kTall; ++m) {
      OCTRAD_UNROLL
      for (int t = 0; t < kWidth; ++t)
        between(warp, tile + static_cast<std::uint32_t>(m), 0, t, c[m][2 * t], c[m][2 * t + 1], h[m][t]);
    }
  }
  constexpr int kSide = 2 / kTall;  // blocks of outputs at a time: four independent sums hide the instruction's latency
  int block = plan.in * kWidth;
  for (int l = 1; l < plan.hidden; ++l) {
    Word next[kTall][kWidth][4];
    OCTRAD_UNROLL
    for (int t = 0; t < kWidth; t += kSide) {
      Float c[kTall][2 * kSide][4];
      OCTRAD_UNROLL
      for (int m = 0; m < kTall; ++m) {
        OCTRAD_UNROLL
        for (int j = 0; j < 2 * kSide; ++j) Warp::clear(c[m][j]);
      }
      warp.need_weights(block + t * kWidth, kSide * kWidth);
      OCTRAD_UNROLL
      for (int k = 0; k < kWidth; ++k) {
        OCTRAD_UNROLL
        for (int j = 0; j < kSide; ++j) {
          Word b[4];
          warp.load_weights(block + (t + j) * kWidth + k, b);
          OCTRAD_UNROLL
          for (int m = 0; m < kTall; ++m) {
            Warp::mma(c[m][2 * j], h[m][k], b[0], b[1]);
            Warp::mma(c[m][2 * j + 1], h[m][k], b[2], b[3]);
          }
        }
      }
      OCTRAD_UNROLL
      for (int m = 0; m < kTall; ++m) {
        OCTRAD_UNROLL
        for (int j = 0; j < kSide; ++j)
          between(warp, tile + static_cast<std::uint32_t>(m), l, t + j, c[m][2 * j], c[m][2 * j + 1], next[m][t + j]);
      }
    }
    OCTRAD_UNROLL
    for (int m = 0; m < kTall; ++m) {
      OCTRAD_UNROLL
      for (int t = 0; t < kWidth; ++t) {
        OCTRAD_UNROLL
        for (int r = 0; r < 4; ++r) h[m][t][r] = next[m][t][r];
      }
    }
    block += kWidth * kWidth;
  }
  const auto write = out.ready();
  for (int t = 0; t < plan.out; ++t) {
    Float c[kTall][2][4];
    OCTRAD_UNROLL
    for (int m = 0; m < kTall; ++m) {
      Warp::clear(c[m][0]);
      Warp::clear(c[m][1]);
    }
    const bool right = outputs > t * kTile + 8;  // whether the right half has columns below `outputs`
    warp.need_weights(block, kWidth);
    OCTRAD_UNROLL
    for (int k = 0; k < kWidth; ++k) {
      Word b[4];
      warp.load_weights(block + k, b);
      OCTRAD_UNROLL
      for (int m = 0; m < kTall; ++m) {
        Warp::mma(c[m][0], h[m][k], b[0], b[1]);
        if (right) Warp::mma(c[m][1], h[m][k], b[2], b[3]);
      }
    }
    block += kWidth;
    OCTRAD_UNROLL
    for (int m = 0; m < kTall; ++m) {
      OCTRAD_UNROLL
      for (int j = 0; j < 2; ++j) {
        OCTRAD_UNROLL
        for (int r = 0; r < 4; ++r) {
          warp.lanes([&](int lane) {
            const std::size_t at = row + static_cast<std::size_t>(m * kTile + fragment_c_row(lane, r));
            const int col = t * kTile + j * 8 + fragment_c_col(lane, r);
            if (at < n && col < outputs) write(at, col, Warp::at(c[m][j][r], lane));
          });
        }
      }
    }
  }
}

// Gradient of a layer's weights W [out][in], from its inputs and the gradients at its outputs, as 16 x 16 operands:
//   dW(o, i) = sum over rows of gradient(row, o) input(row, i).
// A warp makes 2 x 4 blocks of one layer from the 16-row tiles tile_begin .. tile_end - 1; load_gradient(tile, t,
// words) and load_input(tile, t, words) give operand t of a tile; write(o, i, value) takes the result.
template <typename Warp, typename Gradient, typename Input, typename Write>
OCTRAD_HD inline void run_weight_gradient(Warp& warp, int out_tiles, int in_tiles, int o_tile, int i_tile,
                                          std::uint32_t tile_begin, std::uint32_t tile_end,
                                          const Gradient& load_gradient, const Input& load_input, const Write& write) {
  using Word = typename Warp::Word;
  using Float = typename Warp::Float;
  constexpr int kOut = 2, kIn = 4;
  Float c[kOut][2 * kIn][4];
  OCTRAD_UNROLL
  for (int o = 0; o < kOut; ++o) {
    OCTRAD_UNROLL
    for (int j = 0; j < 2 * kIn; ++j) Warp::clear(c[o][j]);
  }
  for (std::uint32_t tile = tile_begin; tile < tile_end; ++tile) {
    // Rows become the summed index: every 8 x 8 part is transposed. The operand's parts, by register: rows 0-7 and
    // columns 0-7, rows 8-15, columns 8-15, both.
    Word a[kOut][4];
    OCTRAD_UNROLL
    for (int o = 0; o < kOut; ++o) {
      Word g[4];
      load_gradient(tile, o_tile + o < out_tiles ? o_tile + o : o_tile, g);  // a duplicate's result is not written
      a[o][0] = Warp::transpose(g[0]);
      a[o][1] = Warp::transpose(g[2]);
      a[o][2] = Warp::transpose(g[1]);
      a[o][3] = Warp::transpose(g[3]);
    }
    OCTRAD_UNROLL
    for (int i = 0; i < kIn; ++i) {
      Word x[4];
      load_input(tile, i_tile + i < in_tiles ? i_tile + i : i_tile, x);
      OCTRAD_UNROLL
      for (int half = 0; half < 2; ++half) {
        const Word b0 = Warp::transpose(x[2 * half]), b1 = Warp::transpose(x[2 * half + 1]);
        OCTRAD_UNROLL
        for (int o = 0; o < kOut; ++o) Warp::mma(c[o][2 * i + half], a[o], b0, b1);
      }
    }
  }
  OCTRAD_UNROLL
  for (int o = 0; o < kOut; ++o) {
    OCTRAD_UNROLL
    for (int j = 0; j < 2 * kIn; ++j) {
      OCTRAD_UNROLL
      for (int r = 0; r < 4; ++r) {
        warp.lanes([&](int lane) {
          write((o_tile + o) * kTile + fragment_c_row(lane, r), i_tile * kTile + j * 8 + fragment_c_col(lane, r),
                Warp::at(c[o][j][r], lane));
        });
      }
    }
  }
}

}  // namespace octrad
