// Networks on the device and their gradients against double precision and against the CPU.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <vector>

#include "octrad/base/random_inputs.h"
#include "octrad/device/stream_test_helper.h"
#include "octrad/network/checks.h"
#include "octrad/network/mlp_device.h"
#include "octrad/network/mlp_reference_test_helper.h"

namespace octrad {
namespace {

struct Case {
  MlpShape shape;
  std::size_t n;
};
const Case kCases[] = {
    {{45, 128, 4, 3}, 203},  // the decoder
    {{28, 64, 2, 1}, 300},   // the disparity predictor
    {{45, 256, 4, 3}, 40},   // nr of the paper
    {{7, 40, 1, 2}, 33},     // nothing is a multiple of anything
    {{141, 128, 2, 20}, 64},
};

// Forward and backward in double precision; `rounded`: with halves where the device has them (gradients times `scale`),
// which decides about neurons close to 0 as the device does.
struct Reference {
  std::vector<std::vector<double>> out, d_in;  // [row][..]
  std::vector<double> d_weights;
};
Reference evaluate(const Mlp& mlp, const std::vector<float>& in, const std::vector<float>& d_out, std::size_t n,
                   bool rounded, double scale) {
  const std::vector<double> weights(mlp.weights().begin(), mlp.weights().end());
  testing::MlpReference network{mlp.shape(), rounded};
  Reference r;
  r.d_weights.resize(weights.size());
  const auto column = [n](const std::vector<float>& rows, std::size_t row) {
    std::vector<double> values;
    for (std::size_t at = row; at < rows.size(); at += n) values.push_back(rows[at]);
    return values;
  };
  for (std::size_t row = 0; row < n; ++row) {
    r.out.push_back(network.forward(column(in, row), weights));
    r.d_in.push_back(network.backward(column(d_out, row), weights, r.d_weights, scale));
  }
  return r;
}

// Share of |got - expected| above `tolerance` times the root mean square of what was expected.
double share_beyond(const std::vector<double>& got, const std::vector<double>& expected, double tolerance) {
  double square = 0.0;
  for (const double e : expected) square += e * e;
  const double unit = std::sqrt(square / static_cast<double>(expected.size())) + 1e-30;
  std::size_t beyond = 0;
  for (std::size_t i = 0; i < got.size(); ++i) beyond += !(std::abs(got[i] - expected[i]) <= tolerance * unit);
  return static_cast<double>(beyond) / static_cast<double>(got.size());
}

class DeviceNetworks : public testing::StreamTest {};

TEST_P(DeviceNetworks, ValuesAndGradientsAreThoseOfTheDefinition) {
  for (const Case& c : kCases) {
    SCOPED_TRACE(std::to_string(c.shape.inputs) + " inputs, width " + std::to_string(c.shape.width));
    const auto inputs = static_cast<std::size_t>(c.shape.inputs), outputs = static_cast<std::size_t>(c.shape.outputs);
    RandomMlp net(*stream, c.shape, c.n, c.n, 3);
    DeviceMlp& device = net.device;
    std::vector<float> d_out = testing::random_floats(outputs * c.n, 2);
    for (std::size_t i = 0; i < d_out.size(); ++i)
      d_out[i] *= i % 3 == 0 ? 1e-6f : 1e-7f;  // far below what halves hold unscaled
    const Reference expected = evaluate(net.mlp, net.inputs, d_out, c.n, true, 0x1p29),
                    exact = evaluate(net.mlp, net.inputs, d_out, c.n, false, 1.0);

    const HalfRows rows = net.in();
    DeviceArray<float> y(*stream, outputs * c.n, "out"), y2(*stream, outputs * c.n, "out"),
        d_in(*stream, inputs * c.n, "d");
    const auto n = static_cast<std::uint32_t>(c.n);
    device.forward(*stream, rows, FloatRows{y.data(), c.n}, n);
    device.forward_keep(*stream, rows, FloatRows{y2.data(), c.n}, n);
    const std::vector<float> out = y.download();
    EXPECT_EQ(out, y2.download());
    std::vector<double> got, want;
    for (std::size_t o = 0; o < outputs; ++o) {
      for (std::size_t i = 0; i < c.n; ++i) {
        got.push_back(out[o * c.n + i]);
        want.push_back(exact.out[i][o]);
      }
    }
    EXPECT_EQ(share_beyond(got, want, 6e-3), 0.0);
    EXPECT_LT(share_beyond(got, want, 1e-3), 0.35);

    const std::vector<float> scale{0x1p29f, 0x1p-29f};
    const DeviceArray<float> s(*stream, std::span<const float>(scale), "scale"),
        d(*stream, std::span<const float>(d_out), "d");
    const int wanted = c.shape.inputs - 5;
    d_in.fill(0);
    device.backward(*stream, rows, FloatRows{d.data(), c.n}, s.data(), FloatRows{d_in.data(), c.n}, wanted, n, false);
    const std::vector<float> di = d_in.download(), dw = device.gradient().download();
    got.clear();
    want.clear();
    for (std::size_t k = 0; k < inputs; ++k) {
      for (std::size_t i = 0; i < c.n; ++i) {
        if (static_cast<int>(k) >= wanted) {
          ASSERT_EQ(di[k * c.n + i], 0.0f) << "an input that was not asked for";
          continue;
        }
        got.push_back(di[k * c.n + i]);
        want.push_back(expected.d_in[i][k]);
      }
    }
    // A neuron whose input is within rounding of 0 may be on either side: few and not far off.
    EXPECT_LT(share_beyond(got, want, 2e-3), 0.03);
    EXPECT_LT(share_beyond(got, want, 0.2), 0.002);
    EXPECT_LT(share_beyond({dw.begin(), dw.end()}, expected.d_weights, 2e-3), 0.03);
    EXPECT_LT(share_beyond({dw.begin(), dw.end()}, expected.d_weights, 5e-2), 0.001);
    EXPECT_LT(share_beyond({dw.begin(), dw.end()}, exact.d_weights, 0.1), 0.02);
    // A second chunk of rows adds; the same work gives the same bits.
    device.backward(*stream, rows, FloatRows{d.data(), c.n}, s.data(), FloatRows{d_in.data(), c.n}, wanted, n, true);
    const std::vector<float> twice = device.gradient().download();
    for (std::size_t i = 0; i < dw.size(); ++i) ASSERT_EQ(twice[i], 2.0f * dw[i]);
    EXPECT_EQ(d_in.download(), di);
  }
}

// Three inputs of a scene in centimetres: what they are as halves does not matter, values and gradients are those of
// the network of centimetres.
TEST_P(DeviceNetworks, MappedInputsAreThoseOfThePlainNetwork) {
  const MlpShape shape{45, 128, 4, 3};
  const std::size_t n = 203, inputs = 45;
  const MlpInputMap map{32, Vec3f(2.0f / 555.0f), Vec3f(-1.0f)};
  RandomMlp net(*stream, shape, n, 0, 3);
  std::vector<float> world = net.inputs, mapped((inputs + 1) * n, 1.0f);
  std::copy(net.inputs.begin(), net.inputs.end(), mapped.begin());
  for (std::size_t k = 0; k < 3; ++k) {
    for (std::size_t i = 0; i < n; ++i) {
      const std::size_t at = (32 + k) * n + i;
      world[at] = (net.inputs[at] * 0.5f + 0.5f) * 555.0f;
      mapped[at] = world[at] * map.scale[static_cast<int>(k)] - 1.0f;
    }
  }
  for (std::size_t o = 0; o < 128; ++o) {
    for (std::size_t k = 32; k < 35; ++k) net.mlp.weights()[o * inputs + k] *= 0.01f;
  }
  net.mlp.prepare();
  DeviceMlp device(*stream, shape, n, "mapped", map);
  device.weights().upload(net.mlp.weights());
  device.refresh(*stream);
  const std::vector<float> d_out = testing::random_floats(3 * n, 2);
  const Reference expected = evaluate(net.mlp, world, d_out, n, false, 1.0);
  const DeviceArray<std::uint32_t> in(*stream, std::span<const std::uint32_t>(RandomMlp::pack(mapped, n)), "in");
  const DeviceArray<float> y(*stream, 3 * n, "out"), d(*stream, std::span<const float>(d_out), "d");
  const std::vector<float> one{16.0f, 1.0f / 16.0f};
  const DeviceArray<float> scale(*stream, std::span<const float>(one), "scale");
  const HalfRows rows{in.data(), n};
  device.forward_keep(*stream, rows, {y.data(), n}, static_cast<std::uint32_t>(n));
  device.backward(*stream, rows, {d.data(), n}, scale.data(), {}, 0, static_cast<std::uint32_t>(n), false);
  const std::vector<float> out = y.download(), dw = device.gradient().download();
  std::vector<double> got(out.begin(), out.end()), want;
  for (std::size_t o = 0; o < 3; ++o) {
    for (std::size_t i = 0; i < n; ++i) want.push_back(expected.out[i][o]);
  }
  EXPECT_EQ(share_beyond(got, want, 1e-2), 0.0);
  EXPECT_LT(share_beyond(got, want, 2e-3), 0.35);
  // Of the mapped inputs' weights alone, which are the largest, and of all the others.
  got.clear();
  want.clear();
  std::vector<double> got_rest, want_rest;
  for (std::size_t i = 0; i < dw.size(); ++i) {
    const bool of_mapped = i < 128 * inputs && map.maps(static_cast<int>(i % inputs));
    (of_mapped ? got : got_rest).push_back(dw[i]);
    (of_mapped ? want : want_rest).push_back(expected.d_weights[i]);
  }
  EXPECT_LT(share_beyond(got, want, 0.1), 0.02);
  EXPECT_LT(share_beyond(got_rest, want_rest, 0.1), 0.02);
}

TEST_P(DeviceNetworks, AgreeWithTheFloatNetworkOfTheCpu) {
  for (const Case& c : kCases)
    EXPECT_TRUE(testing::passed(check_mlp_forward(*stream, c.shape, 256, 5))) << c.shape.inputs << " inputs";
}

TEST_P(DeviceNetworks, RowsDoNotDisturbEachOther) {
  const MlpShape shape{20, 64, 2, 3};
  const std::size_t n = 50;
  const RandomMlp net(*stream, shape, n, 0, 5);
  const DeviceMlp& device = net.device;
  std::vector<float> in = net.inputs;
  const auto run = [&](std::uint32_t rows, QueueSlice slice) {
    const std::vector<std::uint32_t> words = RandomMlp::pack(in, n);
    const DeviceArray<std::uint32_t> x(*stream, std::span<const std::uint32_t>(words), "in");
    DeviceArray<float> y(*stream, 3 * n, "out");
    y.fill(0x11);
    device.forward(*stream, {x.data(), n}, {y.data(), n}, rows, slice);
    return y.download();
  };
  const std::vector<float> before = run(n, {});
  in[7 * n + 20] = std::numeric_limits<float>::quiet_NaN();
  in[7 * n + 21] = 60000.0f;
  const std::vector<float> after = run(n, {});
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t o = 0; o < 3; ++o) {
      if (i == 20) {
        EXPECT_TRUE(std::isnan(after[o * n + i]));
      } else if (i == 21) {
        EXPECT_TRUE(std::isfinite(after[o * n + i])) << "activations that are too large for halves are bounded";
      } else {
        EXPECT_EQ(after[o * n + i], before[o * n + i]);
      }
    }
  }
  const std::vector<std::uint32_t> length{40};
  const DeviceArray<std::uint32_t> count(*stream, std::span<const std::uint32_t>(length), "count");
  const std::vector<float> nothing = run(0, {}), fewer = run(n, {count.data(), 40}), some = run(n, {count.data(), 37});
  EXPECT_EQ(fewer, nothing) << "an empty queue";
  EXPECT_EQ(some[2], before[2]);
  EXPECT_EQ(some[40], nothing[40]);
}

// More than go into one launch, some of them for queries alone; the launches are few.
TEST_P(DeviceNetworks, WeightsArePackedTogetherAsOneByOne) {
  std::vector<std::unique_ptr<RandomMlp>> networks;
  std::vector<DeviceMlp*> all;
  std::vector<std::vector<float>> expected;
  const auto outputs = [&](const Case& c, RandomMlp& net) {
    const DeviceArray<float> out(*stream, static_cast<std::size_t>(c.shape.outputs) * c.n, "out");
    net.device.forward(*stream, net.in(), {out.data(), c.n}, static_cast<std::uint32_t>(c.n));
    return out.download();
  };
  for (const Case& c : kCases) {
    RandomMlp& net = *networks.emplace_back(
        std::make_unique<RandomMlp>(*stream, c.shape, c.n, networks.size() % 3 == 1 ? 0 : c.n, 3));
    all.push_back(&net.device);
    expected.push_back(outputs(c, net));
    DeviceArray<float>& weights = net.device.weights();
    const std::vector<float> own = weights.download();
    weights.fill(0);
    net.device.refresh(*stream);
    ASSERT_NE(outputs(c, net), expected.back());
    weights.upload(own);
  }
  DeviceMlp::refresh_all(*stream, all);
  for (std::size_t k = 0; k < networks.size(); ++k) EXPECT_EQ(outputs(kCases[k], *networks[k]), expected[k]) << k;
  EXPECT_EQ(stream->capture([&] { DeviceMlp::refresh_all(*stream, std::span(all).first(4)); })->size(), 1u);
}

INSTANTIATE_TEST_SUITE_P(All, DeviceNetworks, ::testing::Bool(), testing::stream_name);

}  // namespace
}  // namespace octrad
