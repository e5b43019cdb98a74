// Neural Cone Radiosity on a device against its definition in double with the device's roundings: answers, loss and
// gradients under every switch.
#include <gtest/gtest.h>

#include <string>
#include <tuple>
#include <vector>

#include "octrad/device/stream_test_helper.h"
#include "octrad/model/device_field_test_helper.h"
#include "octrad/model/ncr_reference_test_helper.h"

namespace octrad {
namespace {

using testing::FieldKeys;
using testing::NcrReference;
using testing::TrainingBatch;

constexpr std::size_t kNcrPoints = 140;

// As in field_gradient_device_test.cc, but that rounding adds up over two networks: beyond 1e-3 lie up to 0.56 %
// (world positions, whose halves are coarse). Those of GPUs are a guess that an H200 is within.
const testing::Limits kNcrAnswers[2] = {{1e-7, 1e-5, 0.06, 3e-3}, {1e-4, 3e-3, 0.03, 0.05}};
const testing::Limits kNcrGradients[2] = {{5e-5, 1e-3, 0.015, 2e-2}, {1e-3, 1e-2, 0.05, 0.3}};
constexpr double kNcrLoss[2] = {1e-5, 1e-3};

// Far from the edges of ReLU.
TrainingBatch batch(NcrReference& reference) {
  TrainingBatch result;
  for (const SurfacePoint& p : testing::box_points(kNcrPoints + kNcrPoints / 4, 7)) {
    if (result.points.size() == kNcrPoints) break;
    if (reference.evaluate(p).margin < 1e-5) continue;
    Rng rng(8, RngPurpose::test, result.points.size());
    result.points.push_back(p);
    result.targets.push_back(Vec3f(rng.uniform(), rng.uniform(), rng.uniform()) * 2.0f);
  }
  EXPECT_EQ(result.points.size(), kNcrPoints);
  return result;
}

class DeviceNcr : public ::testing::TestWithParam<std::tuple<std::size_t, bool>> {};

TEST_P(DeviceNcr, GivesAnswersAndGradients) {
  const auto& [number, cuda] = GetParam();
  const auto stream = testing::stream_or_skip(cuda);
  if (!stream) GTEST_SKIP() << testing::kNoDevice;
  const FieldKeys& keys = testing::kNcrSwitches[number];
  SCOPED_TRACE(testing::name_of({"ncr", keys}));
  const Config config = testing::config_of({"ncr", keys});
  for (const bool halves : {true, false}) {
    SCOPED_TRACE(halves ? "tables of halves, sorted sums" : "tables of floats, sums as they come");
    const auto field = testing::field_of(config), cpu = testing::field_of(config);
    NcrReference reference(config, dynamic_cast<NcrField&>(*field), {true, halves});
    const TrainingBatch b = batch(reference);
    DeviceFieldOptions options;
    options.max_points = 100;  // in turns
    options.max_train_points = 256;
    options.half_features = options.deterministic = halves;
    const auto device = make_device_field(*stream, *field, config, options);

    std::vector<double> radiance;
    for (const SurfacePoint& p : b.points) {
      const Vec3d r = reference.radiance(p);
      radiance.insert(radiance.end(), {r.x, r.y, r.z});
    }
    expect_within(kNcrAnswers[cuda], testing::ask(*stream, *device, b.points), radiance, "radiance");

    const testing::DeviceBatch there(*stream, b.points, b.targets);
    const StepConstants constants{static_cast<float>(b.epsilon), 1.0f, 1.0f};
    const DeviceArray<StepConstants> step(*stream, std::span<const StepConstants>(&constants, 1), "constants");
    device->train(there.points(), there.targets.data(), there.n, step.data());
    const DeviceTrainReport report = device->collect();
    ASSERT_EQ(report.losses.size(), 1u);
    const double loss = reference.loss(b, reference.denominators(b));
    EXPECT_NEAR(report.losses[0], loss, kNcrLoss[cuda] * loss);
    EXPECT_EQ(report.non_finite, 0);
    device->download_to(*field);
    const NcrReference::Numbers got = testing::ncr_first_moments(*field), expected = reference.gradient(b);
    for (int part = 0; part < NcrReference::kParts; ++part)
      expect_within(kNcrGradients[cuda], got[part], expected[part], NcrReference::kNames[part]);

    // Which entries were touched, and how often, is the same as on the CPU.
    EXPECT_EQ(report.touched, cpu->train(b.points, b.targets, b.epsilon, 1.0).touched);
    const auto here = testing::tensors_of(*cpu), back = testing::tensors_of(*field);
    for (const auto& [name, tensor] : here) {
      if (name.ends_with(".counts") || name.ends_with(".count")) {
        EXPECT_EQ(back.at(name).values, tensor.values) << name;
      }
    }
  }
}

INSTANTIATE_TEST_SUITE_P(All, DeviceNcr,
                         ::testing::Combine(::testing::Range(std::size_t{0}, testing::kNcrSwitches.size()),
                                            ::testing::Bool()),
                         [](const auto& test) {
                           return testing::name_of({"ncr", testing::kNcrSwitches[std::get<0>(test.param)]}) +
                                  (std::get<1>(test.param) ? "_Cuda" : "_Host");
                         });

}  // namespace
}  // namespace octrad
