// First hits on streams against following the camera's rays on the CPU, sample by sample.
#include "octrad/transport/gbuffer_device.h"

#include "octrad/device/stream_test_helper.h"
#include "octrad/scene/sample_scenes.h"
#include "octrad/transport/checks.h"

namespace octrad {
namespace {

using Bounce = FirstHitOptions::Bounce;

class DeviceGBuffers : public testing::StreamTest {
 protected:
  const PreparedScene scene_{testing::open_room(), PreparedScene::CpuTree::bvh8};
};

TEST_P(DeviceGBuffers, SeeWhatTheCpuSees) {
  for (const float below : {0.0f, kFollowDelta, 0.3f}) {
    for (const Bounce bounce : {Bounce::none, Bounce::glossy, Bounce::all}) {
      FirstHitCase c{{}, bounce != Bounce::all, bounce != Bounce::all};
      c.options.follow_below = below;
      c.options.bounce = bounce;
      c.options.split_coats = bounce != Bounce::all;
      c.options.coat_samples = below > 0.0f ? 20.0f : 0.0f;
      c.options.metal_samples = below == kFollowDelta ? 20.0f : 0.0f;
      c.options.emission_inside = below == 0.3f;
      c.options.max_chain = 5;
      EXPECT_TRUE(testing::passed(check_first_hits(*stream, scene_, camera_job(scene_, 32, 24, 3, 3), {&c, 1})))
          << "bounce " << static_cast<int>(bounce) << ", follow below " << below;
    }
  }
}

TEST_P(DeviceGBuffers, HiddenEmitters) {
  Scene room = testing::open_room();
  room.hide_emitters = true;
  const PreparedScene scene(std::move(room), PreparedScene::CpuTree::bvh8);
  for (const bool follow : {false, true}) {
    FirstHitCase c{{}, true, true};
    c.options.follow_below = follow ? 0.3f : 0.0f;
    EXPECT_TRUE(testing::passed(check_first_hits(*stream, scene, camera_job(scene, 24, 18, 3, 3), {&c, 1})));
  }
}

// The room has something of every kind to see.
TEST(SampleScenes, TheOpenRoomAsksAndBounces) {
  const PreparedScene scene(testing::open_room());
  const CameraJob job = camera_job(scene, 24, 18, 3, 3);
  FirstHitOptions options;
  options.bounce = Bounce::glossy;
  int ends[3] = {0, 0, 0};
  for (std::uint32_t k = 0; k < job.size(); ++k) {
    CameraSample sample = job.sample(k);
    RayEnd end;
    FirstHit first;
    ++ends[static_cast<int>(trace_first_hit(scene.context(), options, sample, end, first).next)];
  }
  for (const int n : ends) EXPECT_GT(n, 40);
}

TEST_P(DeviceGBuffers, MemoryIsWhatWasSaid) {
  const DeviceWorld& world = scene_.world(*stream);
  for (const bool all : {false, true}) {
    const std::size_t before = stream->allocated_bytes(), n = 100'000;
    QueryRays rays;
    rays.offset.traced = rays.offset.reflected = all;
    rays.lobe = all ? 64 : 0;
    const DeviceGBuffer buffer(*stream, world, n, all, rays, all);
    const auto taken = static_cast<double>(stream->allocated_bytes() - before),
               said = static_cast<double>(DeviceGBuffer::bytes(n, all, rays, all));
    EXPECT_NEAR(taken, said, 0.01 * said);
  }
}

INSTANTIATE_TEST_SUITE_P(All, DeviceGBuffers, ::testing::Bool(), testing::stream_name);

}  // namespace
}  // namespace octrad
