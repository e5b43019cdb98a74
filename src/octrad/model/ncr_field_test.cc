// Neural Cone Radiosity as a whole against its definition in double: radiance, loss, and the gradient that training
// hands to the optimiser against central differences. (field_gradient_test.cc says how that gradient is read.)
#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "octrad/model/ncr_reference_test_helper.h"

namespace octrad {
namespace {

using testing::FieldKeys;
using testing::NcrReference;
using testing::TrainingBatch;

struct NcrCase {
  Config config;
  std::unique_ptr<RadianceField> field;
  NcrField& ncr;
  NcrReference reference;

  explicit NcrCase(const FieldKeys& keys)
      : config(testing::config_of({"ncr", keys})),
        field(testing::field_of(config)),
        ncr(dynamic_cast<NcrField&>(*field)),
        reference(config, ncr) {}
};

TrainingBatch batch(std::size_t n) {
  TrainingBatch result;
  result.points = testing::box_points(n, 7);
  Rng rng(8, RngPurpose::test, 1);
  for (std::size_t i = 0; i < n; ++i)
    result.targets.push_back(Vec3f(rng.uniform(), rng.uniform(), rng.uniform()) * 2.0f);
  return result;
}

TEST(NcrField, RadianceIsThatOfTheDefinition) {
  for (const FieldKeys& keys : testing::kNcrSwitches) {
    NcrCase c(keys);
    const TrainingBatch b = batch(150);
    std::vector<Vec3f> out(b.points.size());
    c.field->radiance(b.points, out);
    double worst = 0.0;
    for (std::size_t i = 0; i < out.size(); ++i) {
      const Vec3d expected = c.reference.radiance(b.points[i]);
      for (int k = 0; k < 3; ++k)
        worst = std::max(worst, std::abs(static_cast<double>(out[i][k]) - expected[k]) / (0.1 + expected[k]));
    }
    // What is left is the table of lobe angles, and floats.
    EXPECT_LT(worst, 1e-3) << testing::name_of({"ncr", keys});
    RecordProperty(testing::name_of({"ncr", keys}), std::to_string(worst));
  }
}

TEST(NcrField, GradientsAreTheDerivativesOfTheLoss) {
  for (const FieldKeys& keys : testing::kNcrSwitches) {
    SCOPED_TRACE(testing::name_of({"ncr", keys}));
    NcrCase c(keys);
    const TrainingBatch b = batch(140);  // two groups
    const std::vector<Vec3d> denominators = c.reference.denominators(b);
    const double loss = c.reference.loss(b, denominators);
    const FieldStep step = c.field->train(b.points, b.targets, b.epsilon, 1.0);
    EXPECT_NEAR(step.loss, loss, 1e-4 * loss);
    EXPECT_EQ(step.non_finite, 0);
    const NcrReference::Numbers gradients = testing::ncr_first_moments(*c.field);
    const NcrReference::Numbers by_hand = c.reference.gradient(b);  // what devices are compared with
    for (int part = 0; part < NcrReference::kParts; ++part) {
      SCOPED_TRACE(NcrReference::kNames[part]);
      const std::vector<double>& gradient = gradients[part];
      EXPECT_LT(testing::largest_difference(gradient, by_hand[part]), 2e-3);
      std::vector<double>& parameters = c.reference.parameters[part];
      ASSERT_EQ(gradient.size(), parameters.size());
      double square = 0.0, count = 0.0;
      for (const double g : gradient) {
        square += g * g;
        count += g != 0.0 ? 1.0 : 0.0;
      }
      const bool glossy_only = part >= NcrReference::kConeGrid;
      if (glossy_only && c.config.lookup_rough_threshold == 0.0) {
        EXPECT_EQ(square, 0.0);
        continue;
      }
      ASSERT_GT(square, 0.0);
      // Along random signs of all parameters, relative to the gradient's length, and of single ones.
      Rng rng(9, RngPurpose::test, static_cast<std::uint64_t>(part));
      const auto check = [&](const std::function<double(std::size_t)>& direction, double unit,
                             const std::string& what) {
        constexpr double kStep = 1e-6;
        const std::vector<double> before = parameters;
        double expected = 0.0, got = 0.0;
        for (const double sign : {1.0, -1.0}) {
          for (std::size_t i = 0; i < parameters.size(); ++i) parameters[i] = before[i] + sign * kStep * direction(i);
          expected += sign * c.reference.loss(b, denominators) / (2 * kStep);
        }
        parameters = before;
        for (std::size_t i = 0; i < parameters.size(); ++i) got += gradient[i] * direction(i);
        EXPECT_NEAR(got, expected, 3e-4 * unit) << what;
      };
      for (int d = 0; d < 2; ++d) {
        std::vector<double> signs;
        for (std::size_t i = 0; i < parameters.size(); ++i) signs.push_back(rng.uniform() < 0.5f ? -1.0 : 1.0);
        check([&](std::size_t i) { return signs[i]; }, std::sqrt(square), "direction " + std::to_string(d));
      }
      for (int single = 0; single < 4; ++single) {
        std::size_t at = rng.below(static_cast<std::uint32_t>(gradient.size()));
        while (single < 3 && gradient[at] == 0.0) at = (at + 1) % gradient.size();
        check([&](std::size_t i) { return i == at ? 1.0 : 0.0; }, std::sqrt(square / count),
              "number " + std::to_string(at));
      }
    }
  }
}

TEST(NcrField, SaysWhatItNeedsTraced) {
  Config config = preset("default");
  config.field = "ncr";
  const QueryRays train = query_rays(config, true), render = query_rays(config);
  EXPECT_EQ(train.lobe_rays(0.1f), 128);
  EXPECT_EQ(train.iterations, 10);
  EXPECT_EQ(render.lobe_rays(0.1f), 32);
  EXPECT_EQ(render.iterations, 3);
  EXPECT_EQ(render.clusters, 4);
  EXPECT_EQ(render.count(0.5f), 0);
  EXPECT_FALSE(render.offset.traced);
  config.field = "nr";
  config.lookup_offset = LookupOffset::traced;  // a key of another field
  EXPECT_EQ(query_rays(config).count(0.0f), 0);
  config.field = "octaoctree";
  EXPECT_EQ(query_rays(config).count(0.0f), 1);
}

}  // namespace
}  // namespace octrad
