// Left- and right-hand sides on streams against the CPU's, point by point.
#include "octrad/transport/rhs_device.h"

#include "octrad/base/error.h"
#include "octrad/transport/device_test_helper.h"
#include "octrad/transport/lhs_device.h"
#include "octrad/transport/lhs_sampler.h"
#include "octrad/transport/rhs_estimator.h"

namespace octrad {
namespace {

using testing::DeviceSetup;

class DeviceBatches : public ::testing::TestWithParam<bool> {};

// What a cache says, as good as any.
Vec3f answer(const SurfacePoint& p) {
  return {0.5f + 0.4f * std::sin(3.0f * p.x.x + p.wo.y), 0.5f + 0.4f * std::cos(2.0f * p.x.y + p.n.z) * p.albedo.y,
          0.2f + p.alpha + p.disparity};
}

void expect_same_points(const Stream& stream, const std::vector<ShadingPoint>& found,
                        const std::vector<ShadingPoint>& expected) {
  ASSERT_EQ(found.size(), expected.size());
  std::vector<Vec3f> a, b;
  for (std::size_t i = 0; i < found.size(); ++i) {
    for (const auto& [point, to] : {std::pair{&found[i], &a}, std::pair{&expected[i], &b}}) {
      to->push_back(point->surface.position);
      to->push_back(point->surface.geometric_normal);
      to->push_back(point->wo);
      to->push_back(point->ns);
      to->push_back(point->s);
      to->push_back(point->bsdf.reflectance);
      to->push_back({point->bsdf.alpha_u, point->bsdf.opacity, static_cast<float>(point->surface.shape)});
    }
  }
  testing::expect_same(stream, a, b);
}

TEST_P(DeviceBatches, LeftHandSidesAreTheCpus) {
  const auto stream = testing::stream_or_skip(GetParam());
  if (!stream) GTEST_SKIP() << testing::kNoDevice;
  const DeviceSetup setup(*stream, testing::room());
  const std::size_t n = 1500;
  std::vector<LhsOptions> kinds(5);
  kinds[1].poses = 5;
  kinds[1].keep_direction = 0.3;
  kinds[1].view = 0.2;
  kinds[1].walks = 0.5;
  kinds[2].uniform_glossy = true;
  kinds[2].glossy_boost = 2.0;
  kinds[2].seed = 9;
  kinds[3].walks = 0.0;  // all by area
  kinds[3].glossy_boost = 3.0;
  kinds[4].walks = 1.0;  // walks of which many fail
  kinds[4].max_walk = 2;
  kinds[4].stop_probability = 0.2;
  kinds[4].glossy_boost = 3.0;
  DeviceArray<unsigned long long> step(*stream, 1, "step");
  for (const LhsOptions& options : kinds) {
    const LhsSampler sampler(setup.prepared, options);
    std::vector<ShadingPoint> expected(n);
    sampler.sample(42, expected);
    DeviceLhs lhs(*stream, setup.world(), options, sampler.views(), sampler.fresh_poses(), n);
    const auto graph = stream->capture([&] { lhs.run(step.data(), n, true); });
    for (const unsigned long long s : {41ull, 42ull}) {  // the graph reads the step when it runs
      step.upload(std::span(&s, 1));
      stream->replay(*graph);
    }
    expect_same_points(*stream, testing::fetch(*stream, lhs.points(), n), expected);
    EXPECT_EQ(lhs.take_missing(), 0u);
    testing::HostPlanes seen(*stream, lhs.surface_points().data, lhs.surface_points().stride, kSurfacePointNumbers);
    const SurfacePointArray array{seen.values.data(), seen.stride};
    std::vector<Vec3f> a, b;
    for (std::size_t i = 0; i < n; ++i) {
      const SurfacePoint p = array.load(i), q = surface_point(expected[i]);
      const float disparity = traced_disparity(setup.context, q, expected[i].surface.geometric_normal);
      for (const Vec3f& v : {p.x, p.n, p.wo, p.albedo, Vec3f(p.alpha, p.disparity, 0.0f)}) a.push_back(v);
      for (const Vec3f& v : {q.x, q.n, q.wo, q.albedo, Vec3f(q.alpha, disparity, 0.0f)}) b.push_back(v);
    }
    testing::expect_same(*stream, a, b);
  }
}

TEST_P(DeviceBatches, LeftHandSidesOfManyStepsAtOnceAreTheSame) {
  const auto stream = testing::stream_or_skip(GetParam());
  if (!stream) GTEST_SKIP() << testing::kNoDevice;
  const DeviceSetup setup(*stream, testing::room());
  LhsOptions options;
  options.glossy_boost = 3.0;
  const LhsSampler sampler(setup.prepared, options);
  const std::size_t n = 250;
  DeviceArray<unsigned long long> step(*stream, 1, "step");
  for (const int rounds : {-1, 0, 5}) {  // all that the rounds leave over is drawn to its end
    for (const int steps : {1, 3, 4}) {
      DeviceLhs lhs(*stream, setup.world(), options, sampler.views(), sampler.fresh_poses(), n,
                    n * static_cast<std::size_t>(steps), rounds);
      for (unsigned long long s = 6; s < 11; ++s) {
        step.upload(std::span(&s, 1));
        if (s == 6 || s % static_cast<unsigned long long>(steps) == 0) lhs.draw(step.data(), n, steps);
        lhs.take(step.data(), n, steps);
        std::vector<ShadingPoint> expected(n);
        sampler.sample(s, expected);
        expect_same_points(*stream, testing::fetch(*stream, lhs.points(), n), expected);
        testing::HostPlanes seen(*stream, lhs.surface_points().data, lhs.surface_points().stride, kSurfacePointNumbers);
        const SurfacePointArray array{seen.values.data(), seen.stride};
        std::vector<Vec3f> a, b;
        for (std::size_t i = 0; i < n; ++i) {
          a.insert(a.end(), {array.load(i).x, array.load(i).wo, array.load(i).albedo});
          const SurfacePoint p = surface_point(expected[i]);
          b.insert(b.end(), {p.x, p.wo, p.albedo});
        }
        testing::expect_same(*stream, a, b);
      }
      EXPECT_EQ(lhs.take_missing(), 0u);
    }
  }
}

// A ball seen from inside, where it is black: nothing can be drawn.
TEST_P(DeviceBatches, LeftHandSidesThatAreNotThereAreCounted) {
  const auto stream = testing::stream_or_skip(GetParam());
  if (!stream) GTEST_SKIP() << testing::kNoDevice;
  testing::SceneMaker maker;
  maker.sphere({0, 0, 0}, 1.0f, maker.diffuse(Vec3f(0.5f)));
  maker.scene.cameras.push_back(look_at({0, 0, 0}, {0, 0, 1}, {0, 1, 0}, 50.0f, Camera::FovAxis::x));
  const DeviceSetup setup(*stream, std::move(maker.scene));
  LhsOptions options;
  options.view = 1.0;
  options.walks = 0.0;
  const LhsSampler sampler(setup.prepared, options);
  std::vector<ShadingPoint> expected(1);
  EXPECT_THROW(sampler.sample(0, expected), InputError);
  const std::size_t n = 100;
  DeviceLhs lhs(*stream, setup.world(), options, sampler.views(), sampler.fresh_poses(), n, 4 * n);
  DeviceArray<unsigned long long> step(*stream, 1, "step");
  step.fill(0);
  lhs.draw(step.data(), n, 4);
  EXPECT_EQ(lhs.take_missing(), 0u);  // of other steps than those taken nobody cares
  lhs.take(step.data(), n, 4);
  lhs.take(step.data(), n, 4);
  EXPECT_EQ(lhs.take_missing(), 2 * n);
  EXPECT_EQ(lhs.take_missing(), 0u);
  for (const ShadingPoint& p : testing::fetch(*stream, lhs.points(), n)) EXPECT_LT(p.surface.emitter, 0);
}

TEST_P(DeviceBatches, LeftHandSidesNeedASceneAndMemory) {
  const auto stream = testing::stream_or_skip(GetParam());
  if (!stream) GTEST_SKIP() << testing::kNoDevice;
  const DeviceSetup setup(*stream, testing::room());
  EXPECT_THROW(DeviceLhs(*stream, setup.world(), {}, {}, true, 10), UsageError);
  const LhsSampler sampler(setup.prepared, {});
  DeviceLhs lhs(*stream, setup.world(), {}, sampler.views(), sampler.fresh_poses(), 10);
  const DeviceArray<unsigned long long> step(*stream, 1, "step");
  EXPECT_THROW(lhs.run(step.data(), 11), UsageError);
  EXPECT_THROW(lhs.draw(step.data(), 5, 3), UsageError);
  EXPECT_THROW(lhs.draw(step.data(), 5, 0), UsageError);
  LhsOptions long_walks;
  long_walks.max_walk = 256;  // more than the state of a walk has room for
  EXPECT_THROW(DeviceLhs(*stream, setup.world(), long_walks, sampler.views(), sampler.fresh_poses(), 10), UsageError);
  const std::size_t before = stream->allocated_bytes(), n = 50'000;
  const DeviceLhs large(*stream, setup.world(), {}, sampler.views(), sampler.fresh_poses(), n, 3 * n);
  const auto taken = static_cast<double>(stream->allocated_bytes() - before),
             said = static_cast<double>(DeviceLhs::bytes(n, 3 * n));
  EXPECT_NEAR(taken, said, 0.01 * said);
  Scene empty = testing::room({true, false});
  empty.shapes.clear();
  empty.meshes.clear();
  empty.spheres.clear();
  const DeviceSetup nothing(*stream, std::move(empty));
  EXPECT_THROW(LhsSampler(nothing.prepared, {}), InputError);  // before anything comes to a device
}

struct RhsCase {
  bool environment, lamp, inside, traced, keys, ask;
  int directions;
};

void expect_right_hand_sides(Stream& stream, const RhsCase& c) {
  const DeviceSetup setup(stream, testing::room({c.environment, c.lamp}));
  const std::size_t n = 300;
  LhsOptions draw;
  draw.walks = 0.5;
  const LhsSampler sampler(setup.prepared, draw);
  DeviceArray<unsigned long long> step(stream, 1, "step");
  const unsigned long long number = 5;
  step.upload(std::span(&number, 1));
  DeviceLhs lhs(stream, setup.world(), draw, sampler.views(), sampler.fresh_poses(), n);
  lhs.run(step.data(), n);
  // The same points for the CPU: tables that they point to are its own.
  std::vector<ShadingPoint> points;
  for (const ShadingPoint& p : testing::fetch(stream, lhs.points(), n)) {
    points.push_back(setup.context.shade(p.surface, p.wo));
    points.back().bsdf.opacity = p.bsdf.opacity;
  }

  std::vector<unsigned long long> keys;
  for (std::size_t i = 0; c.keys && i < n; ++i) keys.push_back(mix64(i));
  RhsOptions options;
  options.directions = c.directions;
  options.max_chain = 6;
  options.emission_inside = c.inside;
  options.traced_disparity = c.traced;
  options.seed = 11;
  options.stream = number;
  options.keys = keys;
  std::vector<Vec3f> expected(n);
  const RadianceQuery query = [](std::span<const SurfacePoint> asked, std::span<Vec3f> out) {
    for (std::size_t i = 0; i < asked.size(); ++i) out[i] = answer(asked[i]);
  };
  const RhsStatistics statistics =
      estimate_rhs_serial(setup.context, points, options, c.ask ? query : RadianceQuery(), expected);
  for (std::size_t i = 0; i < n && c.inside; ++i) {
    if (points[i].surface.emitter >= 0) expected[i] += setup.prepared.lights().emitted(points[i].surface, points[i].wo);
  }

  DeviceRhs rhs(stream, setup.world(), n * static_cast<std::size_t>(c.directions), c.traced);
  DeviceRhsOptions device_options;
  device_options.directions = c.directions;
  device_options.max_chain = 6;
  device_options.emission_inside = device_options.own_emission = c.inside;
  device_options.ask = c.ask;
  device_options.seed = 11;
  const DeviceArray<unsigned long long> device_keys(stream, std::span<const unsigned long long>(keys), "keys");
  DeviceRhsPoints device_points;
  device_points.points = lhs.points();
  device_points.most = n;
  device_points.stream = step.data();
  device_points.keys = c.keys ? device_keys.data() : nullptr;
  const auto graph = stream.capture([&] { rhs.trace(device_points, device_options); });
  DeviceArray<Vec3f> answers(stream, rhs.capacity(), "answers"), targets(stream, n, "targets");
  for (int again = 0; again < 2; ++again) {  // nothing is left over from the first time
    stream.replay(*graph);
    const std::uint32_t queries = testing::fetch(stream, rhs.query_count(), 1)[0];
    testing::HostPlanes asked(stream, rhs.queries().data, rhs.queries().stride, kSurfacePointNumbers);
    const SurfacePointArray array{asked.values.data(), asked.stride};
    std::vector<Vec3f> values;
    for (std::uint32_t q = 0; q < queries; ++q) values.push_back(answer(array.load(q)));
    answers.upload(values);
    rhs.reduce(device_points, device_options, answers.data(), targets.data());
    testing::expect_same(stream, targets.download(), expected);
    const TraceCounts counts = rhs.take_counts();
    if (stream.on_device()) {
      EXPECT_NEAR(static_cast<double>(counts.rays), static_cast<double>(statistics.rays),
                  0.01 * static_cast<double>(statistics.rays));
    } else {
      EXPECT_EQ(counts.rays, static_cast<unsigned long long>(statistics.rays));
      EXPECT_EQ(counts.queries, static_cast<unsigned long long>(statistics.queries));
    }
    EXPECT_EQ(counts.non_finite, static_cast<unsigned long long>(statistics.non_finite));
    EXPECT_EQ(queries > 0, c.ask);
    // Answers that are not numbers are dropped and counted, one by one.
    if (queries > 3) {
      values[1] = values[3] = Vec3f(std::nanf(""));
      answers.upload(values);
      rhs.reduce(device_points, device_options, answers.data(), targets.data());
      for (const Vec3f& t : targets.download()) EXPECT_TRUE(is_finite(t));
      EXPECT_EQ(rhs.take_counts().non_finite, counts.non_finite + 2);
    }
  }
}

TEST_P(DeviceBatches, RightHandSidesAreTheCpus) {
  const auto stream = testing::stream_or_skip(GetParam());
  if (!stream) GTEST_SKIP() << testing::kNoDevice;
  expect_right_hand_sides(*stream, {true, true, false, false, false, true, 16});
  expect_right_hand_sides(*stream, {true, false, true, true, true, true, 5});
  expect_right_hand_sides(*stream, {false, true, true, false, true, true, 8});
  expect_right_hand_sides(*stream, {false, true, false, false, false, false, 8});
  expect_right_hand_sides(*stream, {false, false, false, false, false, true, 4});
}

TEST_P(DeviceBatches, TooLittleMemoryIsSaid) {
  const auto stream = testing::stream_or_skip(GetParam());
  if (!stream) GTEST_SKIP() << testing::kNoDevice;
  const DeviceSetup setup(*stream, testing::room());
  DeviceRhs rhs(*stream, setup.world(), 64);
  DeviceRhsPoints points;
  points.most = 17;
  DeviceRhsOptions options;
  options.directions = 4;
  EXPECT_THROW(rhs.trace(points, options), UsageError);
  const std::size_t before = stream->allocated_bytes(), n = 100'000;
  const DeviceRhs large(*stream, setup.world(), n, true);
  const auto taken = static_cast<double>(stream->allocated_bytes() - before),
             said = static_cast<double>(DeviceRhs::bytes(n, true));
  EXPECT_NEAR(taken, said, 0.01 * said);
}

INSTANTIATE_TEST_SUITE_P(All, DeviceBatches, ::testing::Values(false, true), testing::stream_name);

}  // namespace
}  // namespace octrad
