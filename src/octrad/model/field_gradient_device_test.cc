// What fields on a device answer and the gradient that they hand to their optimiser, against the definition with halves
// in the places where a device has them. So the limits are those of sums in floats, not of halves.
#include <gtest/gtest.h>

#include <string>
#include <tuple>
#include <vector>

#include "octrad/device/stream_test_helper.h"
#include "octrad/model/device_field_test_helper.h"
#include "octrad/model/field_switches_test_helper.h"

namespace octrad {
namespace {

using testing::DeviceBatch;
using testing::FieldCase;
using testing::FieldReference;
using testing::TrainingBatch;

constexpr std::size_t kPoints = 140;

void report(const char* what, const std::vector<double>& got, const std::vector<double>& expected) {
  double square = 0.0, count = 0.0;
  for (double v : expected) square += v * v, count += v != 0.0;
  if (count == 0) return;
  std::vector<double> e;
  for (std::size_t i = 0; i < got.size(); ++i) if (expected[i] != 0.0 || got[i] != 0.0) e.push_back(std::abs(got[i] - expected[i]) / std::sqrt(square / count));
  std::sort(e.begin(), e.end());
  const auto q = [&](double x) { return e[std::min(e.size() - 1, static_cast<std::size_t>(x * static_cast<double>(e.size())))]; };
  std::printf("  %-12s %7zu  50%% %.1e 90%% %.1e 99%% %.1e 99.9%% %.1e max %.1e\n", what, e.size(), q(0.5), q(0.9), q(0.99), q(0.999), e.back());
}

class DeviceFieldDefinition : public ::testing::TestWithParam<std::tuple<FieldCase, bool>> {};

TEST_P(DeviceFieldDefinition, AnswersAndGradients) {
  const auto& [c, cuda] = GetParam();
  const auto stream = testing::stream_or_skip(cuda);
  if (!stream) GTEST_SKIP() << testing::kNoDevice;
  for (const bool halves : {true, false}) {
    const Config config = testing::config_of(c);
    const auto field = testing::field_of(config);
    FieldReference reference(config, *field, {true, halves});
    const TrainingBatch batch = reference.batch(kPoints, 5);
    DeviceFieldOptions options;
    options.max_points = options.max_train_points = 256;
    options.half_features = halves;
    options.deterministic = halves;
    const auto device = make_device_field(*stream, *field, config, options);
    std::printf("%s %d\n", testing::name_of(c).c_str(), halves);
    const std::vector<float> answers = testing::ask(*stream, *device, batch.points);
    std::vector<double> want;
    for (const SurfacePoint& p : batch.points) {
      const Vec3d r = reference.evaluate(p).radiance;
      for (int k = 0; k < 3; ++k) want.push_back(r[k]);
    }
    report("radiance", {answers.begin(), answers.end()}, want);
    const DeviceBatch there(*stream, batch.points, batch.targets);
    const StepConstants constants{static_cast<float>(batch.epsilon), 1.0f};
    const DeviceArray<StepConstants> step(*stream, std::span<const StepConstants>(&constants, 1), "constants");
    device->train(there.points(), there.targets.data(), there.n, step.data());
    const DeviceTrainReport report_ = device->collect();
    const double loss = reference.loss(batch, reference.denominators(batch)).value;
    std::printf("  loss %.1e\n", std::abs(report_.losses[0] - loss) / loss);
    device->download_to(*field);
    const FieldReference::Numbers got = testing::first_moments(*field), expected = reference.gradient(batch);
    for (int part = 0; part < FieldReference::kParts; ++part) report(FieldReference::kNames[part], got[part], expected[part]);
  }
}

INSTANTIATE_TEST_SUITE_P(All, DeviceFieldDefinition,
                         ::testing::Combine(::testing::ValuesIn(testing::field_cases()), ::testing::Bool()),
                         [](const auto& test) {
                           return testing::name_of(std::get<0>(test.param)) + (std::get<1>(test.param) ? "_Cuda" : "_Host");
                         });

}  // namespace
}  // namespace octrad
