// Where the perceptron's numbers lie in a warp's registers, and the emulated instruction.
#include <gtest/gtest.h>

#include <set>
#include <tuple>
#include <utility>

#include "octrad/base/rng.h"
#include "octrad/network/warp_matrix.h"

namespace octrad {
namespace {

TEST(MlpFragments, EveryElementHasOnePlace) {
  std::set<std::pair<int, int>> a, b, c;
  for (int lane = 0; lane < kWarp; ++lane) {
    for (int r = 0; r < 4; ++r) {
      a.insert({fragment_a_row(lane, r), fragment_a_col(lane, r)});
      a.insert({fragment_a_row(lane, r), fragment_a_col(lane, r) + 1});
      c.insert({fragment_c_row(lane, r), fragment_c_col(lane, r)});
    }
    for (int r = 0; r < 2; ++r) {
      b.insert({fragment_b_k(lane, r), fragment_b_n(lane)});
      b.insert({fragment_b_k(lane, r) + 1, fragment_b_n(lane)});
    }
  }
  EXPECT_EQ(a.size(), 256u);
  EXPECT_EQ(b.size(), 128u);
  EXPECT_EQ(c.size(), 128u);
  EXPECT_EQ(a.rbegin()->first, 15);
  EXPECT_EQ(b.rbegin()->first, 15);
  EXPECT_EQ(b.rbegin()->second, 7);
  EXPECT_EQ(c.rbegin()->second, 7);
}

TEST(MlpFragments, ResultsLieWhereTheNextOperandIsWanted) {
  // Register r of the operand is the pair of results 2 (r % 2), 2 (r % 2) + 1 of the left (r < 2) or right 16 x 8
  // block.
  for (int lane = 0; lane < kWarp; ++lane) {
    for (int r = 0; r < 4; ++r) {
      for (int half = 0; half < 2; ++half) {
        EXPECT_EQ(fragment_a_row(lane, r), fragment_c_row(lane, 2 * (r & 1) + half));
        EXPECT_EQ(fragment_a_col(lane, r) + half, 8 * (r >> 1) + fragment_c_col(lane, 2 * (r & 1) + half));
      }
    }
  }
}

TEST(MlpFragments, BlocksCoverTheWeightsOnce) {
  for (const MlpPlan plan : {MlpPlan{3, 8, 4, 1}, MlpPlan{2, 4, 2, 1}, MlpPlan{1, 8, 1, 3}, MlpPlan{9, 16, 8, 2}}) {
    std::set<std::tuple<int, int, int>> seen;
    for (int i = 0; i < plan.blocks(); ++i) {
      const MlpBlock b = mlp_block(plan, i);
      ASSERT_LT(b.k_tile, plan.layer_in(b.layer));
      ASSERT_LT(b.n_tile, plan.layer_out(b.layer));
      int begin = 0;  // of the layer
      for (int l = 0; l < b.layer; ++l) begin += plan.layer_in(l) * plan.layer_out(l);
      ASSERT_GE(i, begin);
      seen.insert({b.layer, b.k_tile, b.n_tile});
    }
    int expected = 0;
    for (int l = 0; l < plan.layers(); ++l) expected += plan.layer_in(l) * plan.layer_out(l);
    EXPECT_EQ(static_cast<int>(seen.size()), expected);
    EXPECT_EQ(plan.blocks(), expected);
  }
}

TEST(MlpFragments, EmulatedInstructionMultiplies) {
  Rng rng(1, RngPurpose::test, 0);
  float left[16][16], right[16][8], sum[16][8];
  const auto number = [&] { return to_float(to_half(2.0f * rng.uniform() - 1.0f)); };
  for (auto& row : left)
    for (float& x : row) x = number();
  for (auto& row : right)
    for (float& x : row) x = number();
  for (auto& row : sum)
    for (float& x : row) x = number();
  const HostWarp warp;
  HostWarp::Word a[4], b[2];
  HostWarp::Float c[4];
  for (int r = 0; r < 4; ++r) {
    a[r] = warp.words([&](int lane) {
      return pack_halves(left[fragment_a_row(lane, r)][fragment_a_col(lane, r)],
                         left[fragment_a_row(lane, r)][fragment_a_col(lane, r) + 1]);
    });
    warp.lanes([&](int lane) { HostWarp::at(c[r], lane) = sum[fragment_c_row(lane, r)][fragment_c_col(lane, r)]; });
  }
  for (int r = 0; r < 2; ++r) {
    b[r] = warp.words([&](int lane) {
      return pack_halves(right[fragment_b_k(lane, r)][fragment_b_n(lane)],
                         right[fragment_b_k(lane, r) + 1][fragment_b_n(lane)]);
    });
  }
  HostWarp::mma(c, a, b[0], b[1]);
  for (int r = 0; r < 4; ++r) {
    warp.lanes([&](int lane) {
      const int i = fragment_c_row(lane, r), j = fragment_c_col(lane, r);
      double expected = sum[i][j];
      for (int k = 0; k < 16; ++k) expected += double(left[i][k]) * right[k][j];
      EXPECT_NEAR(HostWarp::at(c[r], lane), expected, 1e-5);
    });
  }
  // The transpose of an 8 x 8 part.
  const HostWarp::Word t = HostWarp::transpose(a[0]);
  for (int lane = 0; lane < kWarp; ++lane) {
    EXPECT_EQ(t.v[lane].x, left[lane % 4 * 2][lane / 4]);
    EXPECT_EQ(t.v[lane].y, left[lane % 4 * 2 + 1][lane / 4]);
  }
}

}  // namespace
}  // namespace octrad
