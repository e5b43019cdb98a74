// Directions drawn by what arrived before: the division of the sphere, what tables learn, and that targets keep their
// means.
#include "octrad/transport/direction_guide.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "octrad/base/sanitized_test_helper.h"
#include "octrad/base/threads.h"
#include "octrad/scene/sample_scenes.h"
#include "octrad/transport/furnace_test_helper.h"
#include "octrad/transport/lhs_sampler.h"
#include "octrad/transport/mean_test_helper.h"
#include "octrad/transport/rhs_estimator.h"

namespace octrad {
namespace {

using testing::furnace;
using testing::FurnaceScene;

Vec3f uniform_direction(Rng& rng) {
  const Vec2f u = rng.uniform2();
  const float z = 1.0f - 2.0f * u.x, r = std::sqrt(std::max(0.0f, 1.0f - z * z));
  return {r * std::cos(2.0f * kPi * u.y), r * std::sin(2.0f * kPi * u.y), z};
}

// The part that a direction is in.
int guide_part(Vec3f direction) { return guide_detail::part(guide_detail::place(direction)); }

// All tables draw a part with a probability in proportion to the root of `square`.
template <typename Square>
void set_tables(GuideState& guide, Square square) {
  for (int table = 0; table < kGuideTables; ++table) {
    guide.samples[static_cast<std::size_t>(table)] = 1ull << 50;  // many: nothing is guessed
    guide.bsdf_squares[static_cast<std::size_t>(table)] = ~0ull;  // and tables are worth it
    for (int part = 0; part < kGuideParts; ++part)
      guide.squares[static_cast<std::size_t>(table * kGuideParts + part)] = square(table, part);
  }
  make_guide_tables(guide.view(0.5f));
}

LhsOptions by_area() {
  LhsOptions options;
  options.walks = 0.0;
  return options;
}

TEST(DirectionGuide, DirectionsAreWhereTheirPartIs) {
  Rng rng(1, RngPurpose::test, 0);
  for (int i = 0; i < 10000; ++i) {
    const Vec3f d = uniform_direction(rng);
    const guide_detail::Place at = guide_detail::place(d);
    const Vec3f back = guide_detail::direction(at.row, at.column);
    EXPECT_NEAR(length(back - d), 0.0f, 2e-3f) << d.x << ' ' << d.y << ' ' << d.z;  // near the poles a row is steep
    EXPECT_NEAR(length(back), 1.0f, 1e-5f);
  }
  for (const Vec3f d : {Vec3f(0, 0, 1), Vec3f(0, 0, -1), Vec3f(1, 0, 0), Vec3f(-1, 0, 0), Vec3f(0, 1, 0),
                        Vec3f(0, -1, 0), Vec3f(-1, -0.0f, 0)}) {
    const int part = guide_part(d);
    EXPECT_GE(part, 0);
    EXPECT_LT(part, kGuideParts);
  }
}

// Shares of many samples against probabilities, and densities against both: the mean of 1 / density over what is drawn
// is the solid angle of what can be.
TEST(DirectionGuide, DensitiesAreThoseOfWhatIsDrawn) {
  const FurnaceScene setup(furnace(testing::kGrey, ""));
  GuideState guide = make_guide(guide_box(LhsSampler(setup.prepared, by_area())), 1.0f);
  const auto square = [](int, int part) {
    return part % 3 == 0 ? 0ull : static_cast<unsigned long long>(part * part) << 24;
  };
  set_tables(guide, square);
  const float *rows = guide.rows.data(), *columns = guide.columns.data();
  double total = 0.0;
  for (int part = 0; part < kGuideParts; ++part) total += std::sqrt(static_cast<double>(square(0, part)));
  constexpr int kSamples = 400000;
  std::vector<int> counts(kGuideParts);
  double inverse = 0.0, area = 0.0, integral = 0.0;
  Rng rng(2, RngPurpose::test, 0);
  for (int i = 0; i < kSamples; ++i) {
    const Vec3f d = guide_direction(rows, columns, rng.uniform2());
    const float density = guide_density(rows, columns, d);
    ASSERT_GT(density, 0.0f);
    ++counts[static_cast<std::size_t>(guide_part(d))];
    inverse += 1.0 / static_cast<double>(density);
    const Vec3f anywhere = uniform_direction(rng);
    const float of_uniform = guide_density(rows, columns, anywhere);
    area += guide_part(anywhere) % 3 != 0;  // others are hardly ever drawn
    integral += static_cast<double>(of_uniform);
  }
  const double sphere = 4.0 * static_cast<double>(kPi);
  EXPECT_NEAR(integral / kSamples * sphere, 1.0, 0.01);
  EXPECT_NEAR(inverse / kSamples, area / kSamples * sphere, 0.1);
  for (int part = 0; part < kGuideParts; ++part) {
    const double expected = kSamples * std::sqrt(static_cast<double>(square(0, part))) / total;
    EXPECT_NEAR(counts[static_cast<std::size_t>(part)], expected, 5.0 * std::sqrt(expected) + 3.0) << part;
  }
}

TEST(DirectionGuide, TablesForgetAndFewSamplesMakeNone) {
  const FurnaceScene setup(furnace(testing::kGrey, ""));
  GuideState guide = make_guide(guide_box(LhsSampler(setup.prepared, by_area())), 2.0f);
  EXPECT_TRUE(guide.valid());
  const GuideView view = guide.view(0.5f);
  EXPECT_FALSE(guide_of(view, 7).known());
  EXPECT_FALSE(guide_of(view, -1).known());
  guide.samples[7] = 1023;
  guide.targets[7] = 1023ull << 20;
  guide.squares[7 * kGuideParts] = 1000;
  guide.bsdf_squares[7] = 1000000;
  make_guide_tables(view);
  EXPECT_FALSE(guide_of(view, 7).known());
  guide.samples[7] = 1024;
  guide.targets[7] = 1024ull << 20;
  make_guide_tables(view);
  EXPECT_TRUE(guide_of(view, 7).known());
  EXPECT_FLOAT_EQ(guide.means[7], 2.0f);  // of targets: one unit each
  EXPECT_EQ(guide.samples[7], 1008u);
  EXPECT_EQ(guide.squares[7 * kGuideParts], 1000u / 64 * 63 + 1000 % 64 * 63 / 64);
  EXPECT_EQ(guide.bsdf_squares[7], 1000000u / 64 * 63);
  // These are few: table 7 is of surfaces along -x, and parts on their side are drawn as well.
  const float *rows = &guide.rows[7 * kGuideRows], *columns = &guide.columns[7 * kGuideParts];
  EXPECT_GT(guide_density(rows, columns, {-1, 0, 0}), 0.0f);
  EXPECT_EQ(guide_density(rows, columns, {1, 0, 0}), 0.0f);
  EXPECT_TRUE(guide.valid());

  // Samples of the BSDF that are as good: the table is left out again.
  guide.samples[7] = 1024;
  guide.bsdf_squares[7] = 1000;
  make_guide_tables(view);
  EXPECT_FALSE(guide_of(view, 7).known());

  const auto broken = [&](auto change) {
    GuideState other = guide;
    change(other);
    return !other.valid();
  };
  EXPECT_TRUE(broken([](GuideState& g) { g.rows[7 * kGuideRows] = 2.0f; }));
  EXPECT_TRUE(broken([](GuideState& g) { g.columns[7 * kGuideParts + 3] = std::nanf(""); }));
  EXPECT_TRUE(broken([](GuideState& g) {
    std::fill_n(&g.rows[9 * kGuideRows], kGuideRows, 1.0f);  // draws a row that has no columns
  }));
  EXPECT_TRUE(broken([](GuideState& g) { g.squares.pop_back(); }));
  EXPECT_TRUE(broken([](GuideState& g) { g.bsdf_squares.pop_back(); }));
  EXPECT_TRUE(broken([](GuideState& g) { g.targets.clear(); }));
  EXPECT_TRUE(broken([](GuideState& g) { g.means[1] = -1.0f; }));
  EXPECT_TRUE(broken([](GuideState& g) { g.unit = 0.0f; }));
  EXPECT_TRUE(broken([](GuideState& g) { std::swap(g.box.lower, g.box.upper); }));
}

// Lamps, an environment, masks, mirrors, coats: with tables that draw where little comes from.
TEST(DirectionGuide, TargetsKeepTheirMeans) {
  if (testing::sanitized()) GTEST_SKIP() << "statistics of many samples; others draw some under the sanitizers";
  for (const int room : {0, 1}) {
    Scene shown = room == 0 ? testing::open_room() : testing::every_material();
    if (shown.cameras.empty())
      shown.cameras.push_back(look_at({0, 0, 4}, {0, 0, 0}, {0, 1, 0}, 50.0f, Camera::FovAxis::x));
    const PreparedScene scene(std::move(shown));
    const LhsSampler sampler(scene, by_area());
    std::vector<ShadingPoint> points(256);
    sampler.sample(0, points);
    GuideState guide = make_guide(guide_box(sampler), 1.0f);
    set_tables(guide,
               [](int table, int part) { return static_cast<unsigned long long>((part * 37 + table) % 128) << 20; });
    const RadianceQuery cache = [](std::span<const SurfacePoint> asked, std::span<Vec3f> out) {
      for (std::size_t i = 0; i < asked.size(); ++i) out[i] = Vec3f(0.2f + 0.2f * std::sin(9.0f * asked[i].x.y));
    };
    testing::Mean means[2];
    std::vector<Vec3f> targets(points.size());
    for (const bool guided : {false, true}) {
      std::vector<Vec3f> of_streams;
      for (unsigned long long stream = 0; stream < 300; ++stream) {
        RhsOptions options;
        options.directions = 16;
        options.stream = stream + (guided ? 1000 : 0);
        if (guided) options.guides = guide.view(0.5f);
        estimate_rhs(scene.context(), points, options, cache, targets);
        Vec3f sum(0.0f);
        for (const Vec3f& target : targets) sum += min(target, Vec3f(1e3f)) / static_cast<float>(targets.size());
        of_streams.push_back(sum);
      }
      means[guided] = testing::mean(of_streams);
    }
    EXPECT_LT(means[1].error, 0.006 * means[1].value) << "too noisy to see anything";
    EXPECT_NEAR(means[1].value, means[0].value,
                4.0 * std::sqrt(means[0].error * means[0].error + means[1].error * means[1].error))
        << room;
  }
}

// A small bright place on a wall, which the BSDF seldom meets.
TEST(DirectionGuide, LearnsWhereLightComesFrom) {
  if (testing::sanitized()) GTEST_SKIP() << "statistics of many samples; others draw some under the sanitizers";
  const FurnaceScene setup(furnace(testing::kGrey, ""));
  const LhsSampler sampler(setup.prepared, by_area());
  const RadianceQuery cache = [](std::span<const SurfacePoint> asked, std::span<Vec3f> out) {
    for (std::size_t i = 0; i < asked.size(); ++i)
      out[i] = Vec3f(length(asked[i].x - Vec3f(0, 0, 1)) < 0.2f ? 50.0f : 0.1f);
  };
  GuideState guide = make_guide(guide_box(sampler), 1.0f);
  std::vector<ShadingPoint> points(512);
  std::vector<Vec3f> targets(points.size());
  RhsOptions options;
  options.directions = 8;
  options.guides = guide.view(0.5f);
  options.learn_guides = true;
  options.epsilon = 0.05f;
  const auto teach = [&](int streams) {
    for (int stream = 0; stream < streams; ++stream) {
      options.stream = static_cast<unsigned long long>(stream);
      sampler.sample(options.stream, points);
      estimate_rhs(setup.context, points, options, cache, targets);
      if (stream % 16 == 15) make_guide_tables(options.guides);
    }
  };
  set_thread_count(1);
  teach(400);
  const GuideState alone = guide;
  guide = make_guide(guide_box(sampler), 1.0f);
  options.guides = guide.view(0.5f);
  set_thread_count(3);
  teach(400);
  set_thread_count(0);
  EXPECT_EQ(alone.squares, guide.squares);
  EXPECT_EQ(alone.samples, guide.samples);
  EXPECT_EQ(alone.columns, guide.columns);
  EXPECT_TRUE(guide.valid());

  options.learn_guides = false;
  sampler.sample(1000, points);
  double value[2] = {}, variance[2] = {}, relative[2] = {};  // of means, sums over the points
  for (const bool guided : {false, true}) {
    options.guides = guided ? guide.view(0.5f) : GuideView();
    std::vector<std::vector<Vec3f>> of_points(points.size());
    for (unsigned long long stream = 2000; stream < 2100; ++stream) {
      options.stream = stream;
      estimate_rhs(setup.context, points, options, cache, targets);
      for (std::size_t i = 0; i < points.size(); ++i) of_points[i].push_back(targets[i]);
    }
    for (const std::vector<Vec3f>& of_point : of_points) {
      const testing::Mean found = testing::mean(of_point);
      value[guided] += found.value;
      variance[guided] += found.error * found.error;
      relative[guided] += found.error / found.value * found.error / found.value;
    }
  }
  EXPECT_NEAR(value[1], value[0], 4.0 * std::sqrt(variance[0] + variance[1]));
  EXPECT_LT(relative[1], 0.5 * relative[0]);
  EXPECT_EQ(alone.squares, guide.squares);  // it was not taught any more
}

}  // namespace
}  // namespace octrad
