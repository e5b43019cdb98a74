#include "octrad/network/mlp.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "octrad/base/each_target_test_helper.h"
#include "octrad/base/random_inputs.h"
#include "octrad/base/rng.h"
#include "octrad/network/mlp_reference_test_helper.h"
#include "octrad/network/mlp_simd.h"

namespace octrad {
namespace {

using octrad::testing::MlpReference;

struct Case {
  MlpShape shape;
  int n, stride;
};

const Case kCases[] = {
    {{45, 128, 4, 3}, 200, 256},                              // decoder
    {{33, 128, 4, 3}, 64, 64},   {{45, 256, 4, 3}, 70, 128},  // Neural Radiosity
    {{28, 64, 2, 1}, 130, 192},                               // disparity
    {{12, 64, 2, 1}, 1, 64},     {{7, 13, 3, 5}, 67, 67},     // nothing is a multiple of anything
    {{1, 1, 1, 1}, 3, 5},        {{5, 9, 1, 19}, 9, 9},      {{17, 40, 0, 3}, 33, 40},  // a single linear layer
    {{64, 48, 2, 16}, 6, 64},
};

class MlpShapes : public ::testing::TestWithParam<Case> {};

TEST_P(MlpShapes, ForwardAndBackwardAgreeWithTheDefinition) {
  const Case c = GetParam();
  Mlp mlp(c.shape);
  mlp.initialize(3, 1);
  const auto inputs = static_cast<std::size_t>(c.shape.inputs), outputs = static_cast<std::size_t>(c.shape.outputs);
  const auto stride = static_cast<std::size_t>(c.stride), n = static_cast<std::size_t>(c.n);
  // Exactly sized buffers, so that a sanitizer sees any access beyond them; NaN in the padding, which must not be read.
  std::vector<float> in = testing::random_floats((inputs - 1) * stride + n, 1),
                     d_out = testing::random_floats((outputs - 1) * stride + n, 2);
  for (auto* buffer : {&in, &d_out}) {
    for (std::size_t j = 0; j < buffer->size(); ++j) {
      if (j % stride >= n) (*buffer)[j] = std::numeric_limits<float>::quiet_NaN();
    }
  }
  const std::vector<double> weights(mlp.weights().begin(), mlp.weights().end());

  std::vector<double> want_out(outputs * n), want_dw(weights.size()), want_din(inputs * n), size_dw(weights.size());
  MlpReference reference{mlp.shape()};
  for (std::size_t i = 0; i < n; ++i) {
    std::vector<double> x(inputs), dy(outputs);
    for (std::size_t f = 0; f < inputs; ++f) x[f] = in[f * stride + i];
    for (std::size_t f = 0; f < outputs; ++f) dy[f] = d_out[f * stride + i];
    const std::vector<double> y = reference.forward(x, weights), dx = reference.backward(dy, weights, want_dw);
    for (std::size_t f = 0; f < outputs; ++f) want_out[f * n + i] = y[f];
    for (std::size_t f = 0; f < inputs; ++f) want_din[f * n + i] = dx[f];
  }

  testing::for_each_simd_target([&] {
    constexpr float kUntouched = 12345.0f;
    std::vector<float> out(d_out.size(), kUntouched), kept_out(d_out.size(), kUntouched), d_in(in.size(), kUntouched);
    std::vector<float> d_weights(weights.size(), 0.5f);
    mlp.forward(in.data(), c.n, c.stride, out.data());
    Mlp::Workspace keep;
    mlp.forward(in.data(), c.n, c.stride, kept_out.data(), keep);
    mlp.backward(in.data(), d_out.data(), keep, d_weights, d_in.data());
    EXPECT_EQ(out, kept_out);
    for (std::size_t j = 0; j < out.size(); ++j) {
      if (j % stride >= n) {
        EXPECT_EQ(out[j], kUntouched);
      } else {
        ASSERT_NEAR(out[j], want_out[j / stride * n + j % stride], 3e-6) << j;
      }
    }
    for (std::size_t j = 0; j < d_in.size(); ++j) {
      if (j % stride >= n) {
        EXPECT_EQ(d_in[j], kUntouched);
      } else {
        ASSERT_NEAR(d_in[j], want_din[j / stride * n + j % stride], 3e-6) << j;
      }
    }
    for (std::size_t j = 0; j < d_weights.size(); ++j)
      ASSERT_NEAR(d_weights[j] - 0.5f, want_dw[j], 2e-6 * static_cast<double>(n + 8)) << j;

    // Without the gradient at the inputs, the rest is the same.
    std::vector<float> again(weights.size(), 0.5f);
    mlp.backward(in.data(), d_out.data(), keep, again, nullptr);
    EXPECT_EQ(d_weights, again);
  });
}

INSTANTIATE_TEST_SUITE_P(Shapes, MlpShapes, ::testing::ValuesIn(kCases), [](const auto& test) {
  const MlpShape& s = test.param.shape;
  return "in" + std::to_string(s.inputs) + "x" + std::to_string(s.width) + "x" + std::to_string(s.hidden) + "to" +
         std::to_string(s.outputs) + "n" + std::to_string(test.param.n);
});

// The double-precision backpropagation above is itself checked by central differences.
TEST(Mlp, ReferenceGradientIsTheDerivative) {
  Mlp mlp({6, 10, 2, 3});
  mlp.initialize(1, 2);
  std::vector<double> weights(mlp.weights().begin(), mlp.weights().end());
  std::vector<double> x{0.3, -0.2, 0.9, 0.5, -0.7, 0.1};
  const std::vector<double> dy{0.4, -1.0, 0.7};
  MlpReference reference{mlp.shape()};
  const auto loss = [&] {
    const std::vector<double> y = reference.forward(x, weights);
    return dy[0] * y[0] + dy[1] * y[1] + dy[2] * y[2];
  };
  loss();
  std::vector<double> dw(weights.size());
  const std::vector<double> dx = reference.backward(dy, weights, dw);
  constexpr double kStep = 1e-6;
  int nonzero = 0;
  const auto check = [&](double& variable, double gradient) {
    const double was = variable;
    variable = was + kStep;
    const double up = loss();
    variable = was - kStep;
    const double down = loss();
    variable = was;
    EXPECT_NEAR((up - down) / (2 * kStep), gradient, 1e-7);
    nonzero += std::abs(gradient) > 1e-3 ? 1 : 0;
  };
  for (std::size_t j = 0; j < weights.size(); ++j) check(weights[j], dw[j]);
  for (std::size_t j = 0; j < x.size(); ++j) check(x[j], dx[j]);
  EXPECT_GT(nonzero, 40);
}

TEST(Mlp, ForwardOfAQueryDoesNotDependOnItsNeighbours) {
  Mlp mlp({45, 128, 4, 3});
  mlp.initialize(5, 0);
  constexpr int kN = 200, kStride = 256;
  const std::vector<float> in = testing::random_floats(45 * kStride, 3);
  testing::for_each_simd_target([&] {
    std::vector<float> whole(3 * kStride), parts(3 * kStride);
    mlp.forward(in.data(), kN, kStride, whole.data());
    for (int begin = 0, size = 1; begin < kN; begin += size, size = size * 2 + 1) {
      mlp.forward(in.data() + begin, std::min(size, kN - begin), kStride, parts.data() + begin);
    }
    EXPECT_EQ(whole, parts);
  });
}

TEST(Mlp, SameBitsOnEveryTargetWithFusedMultiplyAdd) {
  Mlp mlp({45, 100, 3, 3});
  mlp.initialize(6, 0);
  const std::vector<float> in = testing::random_floats(45 * 128, 5), d_out = testing::random_floats(3 * 128, 6);
  std::vector<float> first;
  testing::for_each_simd_target([&] {
    const std::string name = network_simd_name();
    if (name != "AVX2" && name != "AVX3") return;
    std::vector<float> out(3 * 128), d_in(45 * 128), d_weights(mlp.parameter_count());
    Mlp::Workspace keep;
    mlp.forward(in.data(), 101, 128, out.data(), keep);
    mlp.backward(in.data(), d_out.data(), keep, d_weights, d_in.data());
    std::vector<float> all = out;
    all.insert(all.end(), d_in.begin(), d_in.end());
    all.insert(all.end(), d_weights.begin(), d_weights.end());
    if (first.empty()) first = all;
    EXPECT_TRUE(first == all);
  });
}

TEST(Mlp, InitialisationIsXavierUniformAndKeyed) {
  Mlp a({45, 128, 4, 3}), b({45, 128, 4, 3}), c({45, 128, 4, 3});
  a.initialize(1, 0);
  b.initialize(1, 0);
  c.initialize(1, 1);
  EXPECT_TRUE(std::equal(a.weights().begin(), a.weights().end(), b.weights().begin()));
  EXPECT_FALSE(std::equal(a.weights().begin(), a.weights().end(), c.weights().begin()));
  ASSERT_EQ(a.parameter_count(), 45u * 128 + 3 * 128 * 128 + 128 * 3);
  for (int l = 0; l < a.layer_count(); ++l) {
    const double bound = std::sqrt(6.0 / (a.layer_inputs(l) + a.layer_outputs(l)));
    double sum = 0, squares = 0, largest = 0;
    for (float w : a.layer(l)) {
      sum += w;
      squares += static_cast<double>(w) * w;
      largest = std::max(largest, std::abs(static_cast<double>(w)));
    }
    const double n = static_cast<double>(a.layer(l).size());
    EXPECT_LE(largest, bound);
    EXPECT_NEAR(sum / n, 0.0, 4 * bound / std::sqrt(3 * n));
    EXPECT_NEAR(squares / n, bound * bound / 3, 4 * bound * bound * 0.3 / std::sqrt(n));
  }
}

TEST(Mlp, NonFiniteInputIsSeenAtTheOutputOfItsQueryOnly) {
  Mlp mlp({8, 32, 2, 2});
  mlp.initialize(2, 0);
  std::vector<float> in = testing::random_floats(8 * 64, 4), out(2 * 64);
  in[3 * 64 + 17] = std::numeric_limits<float>::quiet_NaN();
  testing::for_each_simd_target([&] {
    mlp.forward(in.data(), 64, 64, out.data());
    for (int i = 0; i < 64; ++i) EXPECT_EQ(std::isfinite(out[static_cast<std::size_t>(i)]), i != 17) << i;
  });
}

TEST(Mlp, ProgramHoldsSeveralInstructionSets) {
#if defined(__x86_64__)
  EXPECT_GE(hwy::SupportedAndGeneratedTargets().size(), 2u);
#endif
}

}  // namespace
}  // namespace octrad
