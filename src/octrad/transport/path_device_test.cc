// The path tracer on streams against trace_paths(), sample by sample.
#include "octrad/transport/path_device.h"

#include <filesystem>

#include "octrad/device/stream_test_helper.h"
#include "octrad/scene/files_test_helper.h"
#include "octrad/scene/load.h"
#include "octrad/scene/sample_scenes.h"
#include "octrad/transport/checks.h"

namespace octrad {
namespace {

constexpr auto kBvh8 = PreparedScene::CpuTree::bvh8;

class DevicePaths : public testing::StreamTest {};

// Every longest path: what vertex d adds is told from what the vertices before it do.
TEST_P(DevicePaths, MatchTheCpuVertexByVertex) {
  for (const testing::OpenRoom& room :
       {testing::OpenRoom{true, true}, testing::OpenRoom{false, true}, testing::OpenRoom{true, false}}) {
    const PreparedScene scene(testing::open_room(room), kBvh8);
    const CameraJob job = camera_job(scene, 24, 18, 4, 3);
    for (const int depth : {0, 1, 2, 3, 4, 5, 6, 9}) {
      const PathLimits limits{depth, 5};
      EXPECT_TRUE(testing::passed(check_paths(*stream, scene, {&job, 1}, {&limits, 1}, 16))) << "depth " << depth;
    }
  }
}

TEST_P(DevicePaths, HiddenEmitters) {
  Scene room = testing::open_room();
  room.hide_emitters = true;
  const PreparedScene scene(std::move(room), kBvh8);
  const CameraJob job = camera_job(scene, 24, 18, 4, 3);
  const PathLimits limits[] = {{1, 5}, {2, 5}, {-1, 5}};
  for (const int waves : {1, 16}) EXPECT_TRUE(testing::passed(check_paths(*stream, scene, {&job, 1}, limits, waves)));
}

// Few bounces with kernels of their own: the rest is finished by one thread each. A window, and some of the samples.
TEST_P(DevicePaths, LongPathsAreFinished) {
  const PreparedScene scene(testing::open_room(), kBvh8);
  CameraJob job = camera_job(scene, 24, 18, 3, 3);
  job.x0 = 5;
  job.y0 = 3;
  job.width = 11;
  job.height = 13;
  job.first = 7;
  const PathLimits limits[] = {{-1, 3}, {12, 5}};
  for (const int waves : {1, 3, 40})
    EXPECT_TRUE(testing::passed(check_paths(*stream, scene, {&job, 1}, limits, waves))) << waves;
}

TEST_P(DevicePaths, RecordedRunsServeOtherViews) {
  const PreparedScene scene(testing::open_room(), kBvh8);
  std::vector<CameraJob> jobs(3, camera_job(scene, 24, 18, 2, 3));
  for (int i = 0; i < 3; ++i) {
    jobs[i].first = 2 * i;
    jobs[i].view = look_at({0.2f * static_cast<float>(i), 1.3f, 4.0f}, {0, 1, 0}, {0, 1, 0}, 50.0f, Camera::FovAxis::x)
                       .view(24, 18);
  }
  jobs[2].height = 5;
  const PathLimits limits{6, 4};
  EXPECT_TRUE(testing::passed(check_paths(*stream, scene, jobs, {&limits, 1}, 16)));
}

// Nothing but sky, and nothing at all.
TEST_P(DevicePaths, EmptyScenes) {
  for (const bool sky : {true, false}) {
    const PreparedScene scene(testing::open_room({sky, false, false}), kBvh8);
    const CameraJob job = camera_job(scene, 24, 18, 1, 3);
    const PathLimits limits{-1, 5};
    EXPECT_TRUE(testing::passed(check_paths(*stream, scene, {&job, 1}, {&limits, 1}, 16))) << sky;
  }
}

// Real scenes: textures, bump maps, coats, many lights, deep trees.
TEST_P(DevicePaths, SharedScenes) {
  int found = 0;
  for (const char* name : {"cornell-box", "kitchen"}) {
    const std::filesystem::path file = shared_folder() / "scenes" / name / "scene.xml";
    if (!std::filesystem::exists(file)) continue;
    ++found;
    const PreparedScene scene(load_scene(file.string()), kBvh8);
    const CameraJob job = camera_job(scene, 48, 32, 2, 3);
    const PathLimits limits{8, 5};
    EXPECT_TRUE(testing::passed(check_paths(*stream, scene, {&job, 1}, {&limits, 1}, 16))) << name;
  }
  if (found == 0) GTEST_SKIP() << "no shared scenes in " << shared_folder();
}

TEST_P(DevicePaths, MemoryIsWhatWasSaid) {
  const PreparedScene scene(testing::open_room(), kBvh8);
  const DeviceWorld& world = scene.world(*stream);
  const std::size_t before = stream->allocated_bytes(), n = 100'000;
  const DevicePathTracer tracer(*stream, world, n);
  const auto taken = static_cast<double>(stream->allocated_bytes() - before),
             said = static_cast<double>(DevicePathTracer::bytes(n));
  EXPECT_NEAR(taken, said, 0.01 * said);
}

INSTANTIATE_TEST_SUITE_P(All, DevicePaths, ::testing::Bool(), testing::stream_name);

}  // namespace
}  // namespace octrad
