// The path tracer on streams against trace_paths(), sample by sample.
#include "octrad/transport/path_device.h"

#include <filesystem>

#include "octrad/scene/files_test_helper.h"
#include "octrad/scene/load.h"
#include "octrad/transport/device_test_helper.h"
#include "octrad/transport/path.h"

namespace octrad {
namespace {

using testing::DeviceSetup;

class DevicePaths : public ::testing::TestWithParam<bool> {};

std::vector<PathSample> on_cpu(const TransportContext& context, const CameraJob& job, const PathLimits& limits,
                               PathCounters& counters) {
  std::vector<PathSample> paths;
  for (std::uint32_t k = 0; k < job.size(); ++k) {
    const CameraSample s = job.sample(k);
    paths.push_back({s.ray, s.rng, {}, {}});
  }
  trace_paths(context, limits, paths, counters);
  return paths;
}

struct Samples {
  std::vector<Vec3f> radiance, albedo, normal, depth_roughness;
};

Samples fetch_samples(Stream& stream, const SamplePlanes& planes, std::size_t n) {
  testing::HostPlanes host(stream, planes.data, planes.stride, kSampleNumbers);
  Samples samples;
  for (std::size_t k = 0; k < n; ++k) {
    samples.radiance.push_back(host.planes().get3(0, k));
    samples.albedo.push_back(host.planes().get3(3, k));
    samples.normal.push_back(host.planes().get3(6, k));
    samples.depth_roughness.push_back({host.planes().get(9, k), host.planes().get(10, k), 0.0f});
  }
  return samples;
}

void expect_cpu_paths(Stream& stream, const DeviceSetup& setup, const SamplePlanes& planes, unsigned long long rays,
                      const CameraJob& job, const PathLimits& limits) {
  PathCounters counters;
  const std::vector<PathSample> paths = on_cpu(setup.context, job, limits, counters);
  const Samples found = fetch_samples(stream, planes, job.size());
  Samples expected;
  for (const PathSample& p : paths) {
    expected.radiance.push_back(p.radiance);
    expected.albedo.push_back(p.first.albedo);
    expected.normal.push_back(p.first.normal);
    expected.depth_roughness.push_back({p.first.depth, p.first.roughness, 0.0f});
  }
  testing::expect_same(stream, found.radiance, expected.radiance);
  testing::expect_same(stream, found.albedo, expected.albedo);
  testing::expect_same(stream, found.normal, expected.normal);
  testing::expect_same(stream, found.depth_roughness, expected.depth_roughness);
  if (stream.on_device())
    EXPECT_NEAR(static_cast<double>(rays), static_cast<double>(counters.rays),
                0.01 * static_cast<double>(counters.rays));
  else EXPECT_EQ(rays, static_cast<unsigned long long>(counters.rays));
}

// Every longest path: what vertex d adds is told from what the vertices before it do.
TEST_P(DevicePaths, MatchTheCpuVertexByVertex) {
  const auto stream = testing::stream_or_skip(GetParam());
  if (!stream) GTEST_SKIP() << testing::kNoDevice;
  for (const testing::BoxOptions& box :
       {testing::BoxOptions{true, true}, testing::BoxOptions{false, true}, testing::BoxOptions{true, false}}) {
    const DeviceSetup setup(*stream, testing::room(box));
    const CameraJob job = testing::whole_picture(setup.scene, 4);
    DevicePathTracer tracer(*stream, setup.world(), job.size());
    tracer.set(job);
    for (const int depth : {0, 1, 2, 3, 4, 5, 6, 9}) {
      SCOPED_TRACE(depth);
      const PathLimits limits{depth, 5};
      tracer.run(limits);
      expect_cpu_paths(*stream, setup, tracer.samples(), tracer.take_rays(), job, limits);
    }
  }
}

// Few bounces with kernels of their own: the rest is finished by one thread each. A window, some of the samples, and
// room for more.
TEST_P(DevicePaths, LongPathsAreFinished) {
  const auto stream = testing::stream_or_skip(GetParam());
  if (!stream) GTEST_SKIP() << testing::kNoDevice;
  const DeviceSetup setup(*stream, testing::room());
  CameraJob job = testing::whole_picture(setup.scene, 3);
  job.x0 = 5;
  job.y0 = 3;
  job.width = 11;
  job.height = 13;
  job.first = 7;
  for (const int waves : {1, 3, 40}) {
    SCOPED_TRACE(waves);
    DevicePathTracer tracer(*stream, setup.world(), 1000, waves);
    tracer.set(job);
    for (const PathLimits& limits : {PathLimits{-1, 3}, PathLimits{12, 5}}) {
      tracer.run(limits, job.size());
      expect_cpu_paths(*stream, setup, tracer.samples(), tracer.take_rays(), job, limits);
    }
  }
}

TEST_P(DevicePaths, RecordedRunsServeOtherViews) {
  const auto stream = testing::stream_or_skip(GetParam());
  if (!stream) GTEST_SKIP() << testing::kNoDevice;
  const DeviceSetup setup(*stream, testing::room());
  CameraJob job = testing::whole_picture(setup.scene, 2);
  DevicePathTracer tracer(*stream, setup.world(), job.size());
  const PathLimits limits{6, 4};
  const auto graph = stream->capture([&] { tracer.run(limits); });
  for (int i = 0; i < 3; ++i) {
    job.first = 2 * i;
    job.view = look_at({0.2f * static_cast<float>(i), 1.3f, 4.0f}, {0, 1, 0}, {0, 1, 0}, 50.0f, Camera::FovAxis::x)
                   .view(job.width, job.height);
    if (i == 2) job.height = 5;
    tracer.set(job);
    stream->replay(*graph);
    expect_cpu_paths(*stream, setup, tracer.samples(), tracer.take_rays(), job, limits);
  }
}

// Nothing but sky, and nothing at all.
TEST_P(DevicePaths, EmptyScenes) {
  const auto stream = testing::stream_or_skip(GetParam());
  if (!stream) GTEST_SKIP() << testing::kNoDevice;
  for (const bool sky : {true, false}) {
    Scene scene = testing::room({sky, false});
    scene.shapes.clear();
    scene.meshes.clear();
    scene.spheres.clear();
    const DeviceSetup setup(*stream, std::move(scene));
    const CameraJob job = testing::whole_picture(setup.scene, 1);
    DevicePathTracer tracer(*stream, setup.world(), job.size());
    tracer.set(job);
    tracer.run({-1, 5});
    expect_cpu_paths(*stream, setup, tracer.samples(), tracer.take_rays(), job, {-1, 5});
    EXPECT_EQ(fetch_samples(*stream, tracer.samples(), 1).radiance[0].x > 0.0f, sky);
  }
}

// Real scenes: textures, bump maps, coats, many lights, deep trees.
TEST_P(DevicePaths, SharedScenes) {
  const auto stream = testing::stream_or_skip(GetParam());
  if (!stream) GTEST_SKIP() << testing::kNoDevice;
  int found = 0;
  for (const char* name : {"cornell-box", "kitchen"}) {
    const std::filesystem::path file = shared_folder() / "scenes" / name / "scene.xml";
    if (!std::filesystem::exists(file)) continue;
    SCOPED_TRACE(name);
    ++found;
    Scene scene = load_scene(file.string());
    scene.cameras.front().film_width = 48;
    scene.cameras.front().film_height = 32;
    const DeviceSetup setup(*stream, std::move(scene));
    const CameraJob job = testing::whole_picture(setup.scene, 2);
    DevicePathTracer tracer(*stream, setup.world(), job.size());
    tracer.set(job);
    tracer.run({8, 5});
    expect_cpu_paths(*stream, setup, tracer.samples(), tracer.take_rays(), job, {8, 5});
  }
  if (found == 0) GTEST_SKIP() << "no shared scenes in " << shared_folder();
}

TEST_P(DevicePaths, MemoryIsWhatWasSaid) {
  const auto stream = testing::stream_or_skip(GetParam());
  if (!stream) GTEST_SKIP() << testing::kNoDevice;
  const DeviceSetup setup(*stream, testing::room());
  const std::size_t before = stream->allocated_bytes(), n = 100'000;
  const DevicePathTracer tracer(*stream, setup.world(), n);
  const auto taken = static_cast<double>(stream->allocated_bytes() - before),
             said = static_cast<double>(DevicePathTracer::bytes(n));
  EXPECT_NEAR(taken, said, 0.01 * said);
}

INSTANTIATE_TEST_SUITE_P(All, DevicePaths, ::testing::Values(false, true), testing::stream_name);

}  // namespace
}  // namespace octrad
