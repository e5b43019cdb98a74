// The gradient that a whole field hands to its optimiser - loss, decoder, features, disparity, hash grid - against
// central differences of its definition in double, under every switch that changes the way.
//
// What the optimiser was given is read from Adam: with adam.beta1 = 0 the first moments after one step of a new
// optimiser are that step's gradient, bit for bit. So nothing stands between this test and training.
//
// By hand (to be repeated when this test changes): each of these made a test here fail, and only tests here: the
// disparity's gradient times 1.001, without disparity_unit_, without the derivative of SquarePlus; the loss's gradient
// with a denominator that is not detached; the taps of the first chunk of a group given to the second.
#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "octrad/model/field_reference_test_helper.h"

namespace octrad {
namespace {

using testing::FieldReference;
using testing::GradientCheck;
using testing::largest_difference;
using testing::TrainingBatch;

using Keys = std::vector<std::pair<std::string, std::string>>;

struct Case {
  std::string field;
  Keys keys;
};

std::string name_of(const Case& c) {
  std::string name = c.field;
  if (c.keys.size() > 5) return name + "_as_in_the_paper";
  for (const auto& [key, value] : c.keys) name.append("_").append(key).append("_").append(value);
  for (char& letter : name) letter = std::isalnum(static_cast<unsigned char>(letter)) ? letter : '_';
  return name;
}

void PrintTo(const Case& c, std::ostream* out) { *out << name_of(c); }

std::vector<Case> cases() {
  std::vector<Case> result;
  const auto add = [&](const std::string& field, const std::vector<Keys>& switches) {
    for (const Keys& keys : switches) result.push_back({field, keys});
  };
  add("octaoctree", {{},
                     {{"lookup.offset", "none"}},
                     {{"lookup.offset", "traced"}},
                     {{"lookup.direction", "outgoing"}},
                     {{"lookup.rough_direction", "mirror"}},
                     {{"octree.interpolation", "nearest"}},
                     {{"octa.interpolation", "nearest"}},
                     {{"octree.features", "2"}},
                     {{"octree.features", "8"}},
                     {{"disparity.features", "4"}},
                     {{"disparity.direction", "false"}},
                     {{"disparity.unit", "world"}},
                     {{"decoder.output", "squareplus"}},
                     {{"decoder.position", "world"}},
                     {{"target.demodulate", "none"}},
                     {{"target.emission", "inside"}},
                     {{"loss.normalizer", "symmetric"}},
                     {{"adam.mode", "dense"}},
                     {{"lookup.rough_threshold", "1.5"}, {"octree.levels", "4"}},
                     // The paper's preset.
                     {{"disparity.direction", "false"},
                      {"disparity.unit", "world"},
                      {"decoder.output", "squareplus"},
                      {"decoder.position", "world"},
                      {"target.emission", "inside"},
                      {"target.demodulate", "none"},
                      {"loss.normalizer", "symmetric"},
                      {"adam.mode", "dense"}}});
  add("nr", {{},
             {{"nr.output", "abs"}},
             {{"nr.output", "squareplus"}},
             {{"nr.features", "2"}},
             {{"nr.features", "4"}},
             {{"decoder.position", "world"}},
             {{"target.demodulate", "none"}},
             {{"target.emission", "inside"}},
             {{"loss.normalizer", "symmetric"}},
             {{"adam.mode", "dense"}}});
  return result;
}

Config config_of(const Case& c) {
  Config config = preset("cpu");
  set(config, "field", c.field);
  const Keys small = {{"octree.levels", "3"},    {"disparity.levels", "3"}, {"disparity.base", "4"},
                      {"disparity.width", "24"}, {"decoder.width", "32"},   {"decoder.hidden", "2"},
                      {"nr.levels", "3"},        {"nr.base", "4"},          {"nr.width", "40"},
                      {"nr.hidden", "2"},        {"nr.log2_table", "10"},   {"disparity.log2_table", "10"},
                      {"adam.beta1", "0"}};
  for (const Keys& keys : {small, c.keys}) {
    for (const auto& [key, value] : keys) set(config, key, value);
  }
  return config;
}

std::unique_ptr<RadianceField> field_of(const Config& config) {
  auto field = make_field(config, testing::box_domain(config.octree_levels));
  testing::fill_tables(*field);
  field->set_target_scale(1.7f);
  return field;
}

constexpr std::size_t kPoints = 140;  // two groups of a training step

// Measured, the largest of all cases: central differences 3.8e-6 (of directions, relative to the gradient's length),
// the field's floats 2.7e-5 (of single numbers, relative to their root mean square), its loss 1.1e-7; of 140 points 2
// lay near an edge, and no difference was left out.
constexpr double kDifferenceLimit = 2e-5, kFloatLimit = 1e-4, kLossLimit = 5e-7;
constexpr int kPointsLeftOut = 7, kDifferencesLeftOut = 1;

class FieldGradients : public ::testing::TestWithParam<Case> {};
INSTANTIATE_TEST_SUITE_P(Switches, FieldGradients, ::testing::ValuesIn(cases()),
                         [](const auto& test) { return name_of(test.param); });

TEST_P(FieldGradients, AreTheDerivativesOfTheLoss) {
  const Config config = config_of(GetParam());
  const auto field = field_of(config);
  FieldReference reference(config, *field, {});
  int left_out = 0;
  const TrainingBatch batch = reference.batch(kPoints, 5, &left_out);
  EXPECT_LE(left_out, kPointsLeftOut);
  const FieldReference::Numbers expected = reference.gradient(batch);
  const double loss = reference.loss(batch, reference.denominators(batch)).value;
  const GradientCheck check = check_gradient(reference, batch, expected);
  EXPECT_LE(check.left_out, kDifferencesLeftOut) << "of " << check.compared;
  EXPECT_LT(check.worst, kDifferenceLimit) << check.where;

  const FieldStep step = field->train(batch.points, batch.targets, batch.epsilon, 1.0);
  EXPECT_NEAR(step.loss, loss, kLossLimit * loss);
  EXPECT_EQ(step.non_finite, 0);
  const FieldReference::Numbers got = testing::first_moments(*field);
  for (int part = 0; part < FieldReference::kParts; ++part)
    EXPECT_LT(largest_difference(got[part], expected[part]), kFloatLimit) << FieldReference::kNames[part];
}

// The check itself: it must not pass a gradient of which one part is 1/1000 off, or one number of a part missing.
TEST(FieldGradientCheck, FindsWrongFactorsAndMissingNumbers) {
  const Config config = config_of({"octaoctree", {}});
  const auto field = field_of(config);
  FieldReference reference(config, *field, {});
  const TrainingBatch batch = reference.batch(kPoints, 5);
  const FieldReference::Numbers right = reference.gradient(batch);
  for (int part = 0; part < FieldReference::kParts; ++part) {
    SCOPED_TRACE(FieldReference::kNames[part]);
    FieldReference::Numbers wrong = right;
    for (double& v : wrong[part]) v *= 1.001;
    EXPECT_GT(check_gradient(reference, batch, wrong).worst, 10 * kDifferenceLimit);
    EXPECT_GT(largest_difference(wrong[part], right[part]), 10 * kFloatLimit);
    wrong = right;
    double square = 0.0, count = 0.0;
    for (const double v : right[part]) {
      square += v * v;
      count += v != 0.0 ? 1.0 : 0.0;
    }
    for (double& v : wrong[part]) {
      if (v * v < square / count) continue;  // the first one of at least the usual size
      v = 0.0;
      break;
    }
    EXPECT_GT(check_gradient(reference, batch, wrong).worst, 10 * kDifferenceLimit);
  }
}

// A batch so large that its groups have several chunks: the gradient is the mean of those of its halves.
TEST(FieldGradient, OfALargeBatchIsThatOfItsHalves) {
  for (const std::string& name : field_names()) {
    const Config config = config_of({name, {}});
    const std::vector<SurfacePoint> points = testing::box_points(5000, 3);
    std::vector<Vec3f> targets;
    for (const SurfacePoint& p : points) targets.push_back(testing::pattern(p));
    const auto gradient = [&](std::size_t begin, std::size_t count) {
      const auto field = field_of(config);
      field->train(std::span(points).subspan(begin, count), std::span(targets).subspan(begin, count), 0.3, 1.0);
      return testing::first_moments(*field);
    };
    const FieldReference::Numbers whole = gradient(0, 5000), left = gradient(0, 2500), right = gradient(2500, 2500);
    for (int part = 0; part < FieldReference::kParts; ++part) {
      std::vector<double> mean;
      for (std::size_t i = 0; i < left[part].size(); ++i) mean.push_back((left[part][i] + right[part][i]) / 2);
      const double d = largest_difference(whole[part], mean);
      std::printf("%s %s %g\n", name.c_str(), FieldReference::kNames[part], d);
      EXPECT_LT(d, kFloatLimit) << name << " " << FieldReference::kNames[part];
    }
  }
}

}  // namespace
}  // namespace octrad
