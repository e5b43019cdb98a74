// Layout of matrices in the registers of a warp, for the instruction D = A B + C on 16 x 16 times 16 x 8
// halves with float sums (PTX ISA, mma.m16n8k16), and how a network's weights are laid out for it. All of it
// constant expressions, so that a test checks them on the host.
//
// The instruction returns a layer's output with rows and columns exactly where the next layer's input must be: two
// adjacent 16 x 8 results, rounded to halves and paired, are one 16 x 16 operand. So activations never leave
// registers.
#pragma once

#include <cstdint>

#include "octrad/base/hd.h"

namespace octrad {

inline constexpr int kWarp = 32;                       // lanes
inline constexpr int kTile = 16;                       // rows and columns of a block of weights or activations
inline constexpr int kBlockWords = kTile * kTile / 2;  // a block as packed halves: 4 words a lane

// Register r = 0..3 of a lane holds A(row, col) in its low half and A(row, col + 1) in its high one.
OCTRAD_HD constexpr int fragment_a_row(int lane, int r) { return lane / 4 + 8 * (r & 1); }
OCTRAD_HD constexpr int fragment_a_col(int lane, int r) { return lane % 4 * 2 + 8 * (r >> 1); }
// Register r = 0..1: B(k, n) and B(k + 1, n).
OCTRAD_HD constexpr int fragment_b_k(int lane, int r) { return lane % 4 * 2 + 8 * r; }
OCTRAD_HD constexpr int fragment_b_n(int lane) { return lane / 4; }
// Register r = 0..3: C(row, col), one float.
OCTRAD_HD constexpr int fragment_c_row(int lane, int r) { return lane / 4 + 8 * (r >> 1); }
OCTRAD_HD constexpr int fragment_c_col(int lane, int r) { return lane % 4 * 2 + (r & 1); }

// Shape of a network in blocks of 16, the last ones padded with zeros.
struct MlpPlan {
  int in = 0, width = 0, hidden = 0, out = 0;  // hidden >= 1 layers of 16 width neurons

  OCTRAD_HD constexpr int layers() const { return hidden + 1; }
  OCTRAD_HD constexpr int layer_in(int l) const { return l == 0 ? in : width; }
  OCTRAD_HD constexpr int layer_out(int l) const { return l == hidden ? out : width; }
  // Blocks of weights, in the order in which the network's layers use them: the first layer input by input, because its
  // inputs are read from memory one after the other, the others output by output; `width` blocks at a time.
  OCTRAD_HD constexpr int blocks() const { return width * (in + (hidden - 1) * width + out); }
};

// Which weights a block holds: rows k = 16 k_tile .. of the operand B(k, n), columns n = 16 n_tile ...
struct MlpBlock {
  int layer, k_tile, n_tile;
};
OCTRAD_HD constexpr MlpBlock mlp_block(const MlpPlan& plan, int block) {
  if (block < plan.width * plan.in) return {0, block / plan.width, block % plan.width};
  const int rest = block - plan.width * plan.in, square = plan.width * plan.width;
  const int layer = rest / square < plan.hidden - 1 ? 1 + rest / square : plan.hidden;
  const int in_layer = rest - (layer - 1) * square;
  return {layer, in_layer % plan.width, in_layer / plan.width};
}

// Word r of a lane in a block: B(k, n) and B(k + 1, n), relative to the block. Words 0, 1 are the left 16 x 8 half.
OCTRAD_HD constexpr int mlp_word_k(int lane, int r) { return fragment_b_k(lane, r & 1); }
OCTRAD_HD constexpr int mlp_word_n(int lane, int r) { return fragment_b_n(lane) + 8 * (r >> 1); }

}  // namespace octrad
