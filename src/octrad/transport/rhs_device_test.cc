// Left- and right-hand sides on streams against the CPU's, point by point.
#include "octrad/transport/rhs_device.h"

#include "octrad/base/error.h"
#include "octrad/device/stream_test_helper.h"
#include "octrad/scene/sample_scenes.h"
#include "octrad/transport/checks.h"
#include "octrad/transport/lhs_device.h"
#include "octrad/transport/lhs_sampler.h"

namespace octrad {
namespace {

class DeviceBatches : public testing::StreamTest {};

TEST_P(DeviceBatches, LeftHandSidesAreTheCpus) {
  const PreparedScene scene(testing::open_room(), PreparedScene::CpuTree::bvh8);
  Scene hiding = testing::open_room();
  hiding.hide_emitters = true;
  const PreparedScene hidden(std::move(hiding), PreparedScene::CpuTree::bvh8);
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
  for (std::size_t k = 0; k < kinds.size(); ++k) {
    EXPECT_TRUE(testing::passed(check_left_hand_sides(*stream, scene, kinds[k], 1500, 41, 1))) << k;
    EXPECT_TRUE(testing::passed(check_left_hand_sides(*stream, hidden, kinds[k], 1500, 41, 1))) << k;
  }
}

TEST_P(DeviceBatches, LeftHandSidesOfManyStepsAtOnceAreTheSame) {
  const PreparedScene scene(testing::open_room(), PreparedScene::CpuTree::bvh8);
  LhsOptions options;
  options.glossy_boost = 3.0;
  for (const int rounds : {-1, 0, 5}) {  // all that the rounds leave over is drawn to its end
    for (const int steps : {1, 3, 4})
      EXPECT_TRUE(testing::passed(check_left_hand_sides(*stream, scene, options, 250, 6, steps, rounds))) << steps;
  }
}

// A ball of nothing: no point can be drawn.
TEST_P(DeviceBatches, LeftHandSidesThatAreNotThereAreCounted) {
  testing::SceneMaker maker;
  Material nothing;
  nothing.type = BsdfType::null;
  maker.sphere({0, 0, 0}, 1.0f, maker.material(nothing));
  maker.scene.cameras.push_back(look_at({0, 0, 0}, {0, 0, 1}, {0, 1, 0}, 50.0f, Camera::FovAxis::x));
  const PreparedScene scene(std::move(maker.scene), PreparedScene::CpuTree::bvh8);
  LhsOptions options;
  options.view = 1.0;
  options.walks = 0.0;
  const LhsSampler sampler(scene, options);
  std::vector<ShadingPoint> expected(1);
  EXPECT_THROW(sampler.sample(0, expected), InputError);
  const std::size_t n = 100;
  DeviceLhs lhs(*stream, scene.world(*stream), options, sampler.views(), sampler.fresh_poses(), n, 4 * n);
  DeviceArray<unsigned long long> step(*stream, 1, "step");
  step.fill(0);
  lhs.draw(step.data(), n, 4);
  EXPECT_EQ(lhs.take_missing(), 0u);  // of other steps than those taken nobody cares
  lhs.take(step.data(), n, 4);
  lhs.take(step.data(), n, 4);
  EXPECT_EQ(lhs.take_missing(), 2 * n);
  EXPECT_EQ(lhs.take_missing(), 0u);
  for (const ShadingPoint& p : fetch(*stream, lhs.points(), n)) EXPECT_LT(p.surface.emitter, 0);
}

TEST_P(DeviceBatches, LeftHandSidesNeedASceneAndMemory) {
  const PreparedScene scene(testing::open_room(), PreparedScene::CpuTree::bvh8);
  EXPECT_THROW(DeviceLhs(*stream, scene.world(*stream), {}, {}, true, 10), UsageError);
  const LhsSampler sampler(scene, {});
  DeviceLhs lhs(*stream, scene.world(*stream), {}, sampler.views(), sampler.fresh_poses(), 10);
  const DeviceArray<unsigned long long> step(*stream, 1, "step");
  EXPECT_THROW(lhs.run(step.data(), 11), UsageError);
  EXPECT_THROW(lhs.draw(step.data(), 5, 3), UsageError);
  EXPECT_THROW(lhs.draw(step.data(), 5, 0), UsageError);
  LhsOptions long_walks;
  long_walks.max_walk = 256;  // more than the state of a walk has room for
  EXPECT_THROW(DeviceLhs(*stream, scene.world(*stream), long_walks, sampler.views(), sampler.fresh_poses(), 10),
               UsageError);
  const std::size_t before = stream->allocated_bytes(), n = 50'000;
  const DeviceLhs large(*stream, scene.world(*stream), {}, sampler.views(), sampler.fresh_poses(), n, 3 * n);
  const auto taken = static_cast<double>(stream->allocated_bytes() - before),
             said = static_cast<double>(DeviceLhs::bytes(n, 3 * n));
  EXPECT_NEAR(taken, said, 0.01 * said);
  const PreparedScene nothing(testing::open_room({true, false, false}));
  EXPECT_THROW(LhsSampler(nothing, {}), InputError);  // before anything comes to a device
}

TEST_P(DeviceBatches, RightHandSidesAreTheCpus) {
  const std::pair<testing::OpenRoom, RhsCase> cases[] = {
      {{true, true}, {16, false, false, false, true, true, 0.3f, true}},
      {{true, true}, {16, false, false, false, true, false, 0.3f, true, true}},
      {{true, false}, {8, true, false, true, true, false, 0.3f, true, true}},
      {{true, true}, {8, false, false, false, false, false, 0.3f, true, true}},
      {{true, false}, {5, true, true, true, true, true}},
      {{false, true}, {8, true, false, true, true, false, 0.3f}},
      {{false, true}, {8, false, false, false, false}},
      {{false, false}, {4, false, false, false, true}}};
  for (const auto& [room, c] : cases) {
    const PreparedScene scene(testing::open_room(room), PreparedScene::CpuTree::bvh8);
    EXPECT_TRUE(testing::passed(check_right_hand_sides(*stream, scene, {&c, 1}, 300, 11)))
        << c.directions << " directions";
  }
}

TEST_P(DeviceBatches, ClustersOfHitsAreTheCpus) {
  const PreparedScene scene(testing::open_room(), PreparedScene::CpuTree::bvh8);
  QueryRays rays;
  rays.lobe_below = 0.5f;
  rays.lobe = 32;
  rays.iterations = 3;
  EXPECT_TRUE(testing::passed(check_lobes(*stream, scene, 1000, rays, 3)));
  rays.clusters = 3;
  rays.iterations = 10;
  rays.lobe = 7;
  EXPECT_TRUE(testing::passed(check_lobes(*stream, scene, 500, rays, 4)));
}

TEST_P(DeviceBatches, TooLittleMemoryIsSaid) {
  const PreparedScene scene(testing::open_room(), PreparedScene::CpuTree::bvh8);
  DeviceRhs rhs(*stream, scene.world(*stream), 64);
  DeviceRhsPoints points;
  points.most = 17;
  DeviceRhsOptions options;
  options.directions = 4;
  EXPECT_THROW(rhs.trace(points, options), UsageError);
  points.most = 16;
  float rows = 0.0f;
  options.guides.rows = &rows;
  EXPECT_THROW(rhs.trace(points, options), UsageError);
  points.most = 17;
  const std::size_t before = stream->allocated_bytes(), n = 100'000;
  QueryRays rays;
  rays.offset.traced = rays.offset.reflected = true;
  rays.lobe = 32;
  const DeviceRhs large(*stream, scene.world(*stream), n, rays);
  const auto taken = static_cast<double>(stream->allocated_bytes() - before),
             said = static_cast<double>(DeviceRhs::bytes(n, rays));
  EXPECT_NEAR(taken, said, 0.01 * said);
  const DeviceRhs guided(*stream, scene.world(*stream), n, rays, true);
  const auto more = static_cast<double>(stream->allocated_bytes() - before) - taken,
             said_more = static_cast<double>(DeviceRhs::bytes(n, rays, true));
  EXPECT_NEAR(more, said_more, 0.01 * said_more);
}

INSTANTIATE_TEST_SUITE_P(All, DeviceBatches, ::testing::Bool(), testing::stream_name);

}  // namespace
}  // namespace octrad
