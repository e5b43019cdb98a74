// The gradient that a whole field hands to its optimiser - loss, decoder, features, disparity, hash grid - against
// central differences of its definition in double, under every switch that changes the way.
//
// What the optimiser was given is read from Adam: with adam.beta1 = 0 the first moments after one step of a new
// optimiser are that step's gradient, bit for bit. So nothing stands between this test and training.
//
// Mistakes put into the code by hand, with what failed here: the disparity's gradient times 1.001, without
// disparity_unit_, with SquarePlus in place of its derivative, or without the first level's features (all 17 cases with
// a predicted disparity that octahedral interpolation lets a gradient through to; 15 where the unit is not 1); the
// loss's gradient with a denominator that is not detached, or without the factor of demodulation and exposure (all 30);
// the hash grid's gradient taken from another chunk's points (all, and the test of large batches). Of the other tests
// of this room only the last was seen, by those of determinism.
#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "octrad/model/field_switches_test_helper.h"

namespace octrad {
namespace {

using testing::FieldCase;
using testing::FieldReference;
using testing::largest_difference;
using testing::TrainingBatch;

// How far a gradient is from central differences of the reference's loss, part by part: along directions of +-1 in all
// parameters, which any wrong number shows in, and along single parameters. Steps that leave the smooth piece of the
// loss are halved, and left out and counted if that does not help.
struct GradientCheck {
  double worst = 0.0;  // largest difference, relative to the length of the part's gradient or, of single parameters, to
                       // their root mean square where they are not 0
  std::string where;
  int compared = 0, left_out = 0;
};

GradientCheck check_gradient(FieldReference& reference, const TrainingBatch& batch,
                             const FieldReference::Numbers& gradient) {
  constexpr int kDirections = 3, kSingles = 12;
  constexpr double kStep = 4e-5;
  GradientCheck check;
  const std::vector<double> denominators = reference.denominators(batch);
  const std::uint64_t piece = reference.loss(batch, denominators).piece;
  const auto compare = [&](int part, const std::vector<std::pair<std::size_t, double>>& direction, double unit,
                           const std::string& where) {
    std::vector<double>& parameters = reference.parameters[part];
    const auto loss_at = [&](double step) {
      for (const auto& [at, sign] : direction) parameters[at] += sign * step;
      const FieldReference::Loss loss = reference.loss(batch, denominators);
      for (const auto& [at, sign] : direction) parameters[at] -= sign * step;
      return loss;
    };
    ++check.compared;
    double step = kStep;
    for (int halvings = 0;; ++halvings, step /= 2) {
      const FieldReference::Loss up = loss_at(step), down = loss_at(-step);
      if (up.piece == piece && down.piece == piece) {
        double expected = (up.value - down.value) / (2 * step), got = 0.0;
        for (const auto& [at, sign] : direction) got += sign * gradient[part][at];
        const double error = unit > 0.0 ? std::abs(got - expected) / unit : std::abs(got - expected);
        if (!(error <= check.worst)) {
          check.worst = error;
          check.where = std::string(FieldReference::kNames[part]) + " " + where;
        }
        return;
      }
      if (halvings == 4) break;
    }
    ++check.left_out;
  };
  for (int part = 0; part < FieldReference::kParts; ++part) {
    const std::vector<double>& g = gradient[part];
    std::vector<std::size_t> nonzero;
    double square = 0.0;
    for (std::size_t i = 0; i < g.size(); ++i) {
      square += g[i] * g[i];
      if (g[i] != 0.0) nonzero.push_back(i);
    }
    if (g.size() != reference.parameters[part].size()) {
      ADD_FAILURE() << FieldReference::kNames[part] << " has " << g.size() << " numbers";
      continue;
    }
    if (g.empty()) continue;
    Rng rng(1, RngPurpose::test, static_cast<std::uint64_t>(part));
    for (int d = 0; d < kDirections; ++d) {
      std::vector<std::pair<std::size_t, double>> direction;
      for (std::size_t i = 0; i < g.size(); ++i) direction.push_back({i, rng.uniform() < 0.5f ? -1.0 : 1.0});
      compare(part, direction, std::sqrt(square), "direction " + std::to_string(d));
    }
    if (nonzero.empty()) continue;
    const double unit = std::sqrt(square / static_cast<double>(nonzero.size()));
    for (int s = 0; s < kSingles; ++s) {
      const std::size_t at = s < kSingles / 2 ? nonzero[rng.below(static_cast<std::uint32_t>(nonzero.size()))]
                                              : rng.below(static_cast<std::uint32_t>(g.size()));
      compare(part, {{at, 1.0}}, unit, "number " + std::to_string(at));
    }
  }
  return check;
}

constexpr std::size_t kPoints = 140;  // two groups of a training step

// Measured, the largest of all cases: central differences 3.8e-6 (of directions, relative to the gradient's length),
// the field's floats 2.7e-5 (of single numbers, relative to their root mean square), its loss 1.1e-7; of 140 points 2
// lay near an edge, and no difference was left out.
constexpr double kDifferenceLimit = 2e-5, kFloatLimit = 1e-4, kLossLimit = 5e-7;
constexpr int kPointsLeftOut = 7, kDifferencesLeftOut = 1;

class FieldGradients : public ::testing::TestWithParam<FieldCase> {};
INSTANTIATE_TEST_SUITE_P(Switches, FieldGradients, ::testing::ValuesIn(testing::field_cases()),
                         [](const auto& test) { return testing::name_of(test.param); });

TEST_P(FieldGradients, AreTheDerivativesOfTheLoss) {
  const Config config = testing::config_of(GetParam());
  const auto field = testing::field_of(config);
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
  const Config config = testing::config_of({"octaoctree", {}});
  const auto field = testing::field_of(config);
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

// A batch so large that its groups have several chunks: the gradient is the mean of those of its halves (measured: 4e-5
// apart).
TEST(FieldGradient, OfALargeBatchIsThatOfItsHalves) {
  for (const std::string& name : field_names()) {
    const Config config = testing::config_of({name, {}});
    const std::vector<SurfacePoint> points = testing::box_points(5000, 3);
    std::vector<Vec3f> targets;
    for (const SurfacePoint& p : points) targets.push_back(testing::pattern(p));
    const auto gradient = [&](std::size_t begin, std::size_t count) {
      const auto field = testing::field_of(config);
      field->train(std::span(points).subspan(begin, count), std::span(targets).subspan(begin, count), 0.3, 1.0);
      return testing::first_moments(*field);
    };
    const FieldReference::Numbers whole = gradient(0, 5000), left = gradient(0, 2500), right = gradient(2500, 2500);
    for (int part = 0; part < FieldReference::kParts; ++part) {
      std::vector<double> mean;
      for (std::size_t i = 0; i < left[part].size(); ++i) mean.push_back((left[part][i] + right[part][i]) / 2);
      EXPECT_LT(largest_difference(whole[part], mean), kFloatLimit) << name << " " << FieldReference::kNames[part];
    }
  }
}

}  // namespace
}  // namespace octrad
