// Pictures of a stream against pictures of the CPU.
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <fstream>

#include "octrad/base/error.h"
#include "octrad/base/rng.h"
#include "octrad/device/stream_test_helper.h"
#include "octrad/geometry/bvh8.h"
#include "octrad/geometry/voxelize.h"
#include "octrad/image/metrics.h"
#include "octrad/render/cache_integrators.h"
#include "octrad/render/device_render.h"
#include "octrad/render/path_integrator.h"
#include "octrad/scene/load.h"
#include "octrad/transport/prepared_scene.h"

namespace octrad {
namespace {

// A lit box with a glossy and a mirror ball. The CPU walks the same tree as the device.
struct Box {
  PreparedScene prepared;
  const Scene& scene = prepared.scene();
  TransportContext context = prepared.context();
  Config config = preset("cpu");
  std::unique_ptr<RadianceField> field;

  explicit Box(const std::string& filter = "gaussian") : prepared(load(filter), PreparedScene::CpuTree::bvh8) {
    config.octree_levels = 3;
    config.disparity_log2_table = 10;
    const Domain box = scene_domain(scene.bounds, config.octree_box == OctreeBox::cube);
    field = make_field(config, {box.origin, box.size, occupied_cells(scene, box, config.octree_levels)});
    field->set_target_scale(1.0f);
    // Something to see: a few steps towards a made-up radiance.
    Rng rng(7, RngPurpose::test, 0);
    std::vector<SurfacePoint> points(256);
    std::vector<Vec3f> targets(256);
    for (int step = 0; step < 20; ++step) {
      for (std::size_t i = 0; i < points.size(); ++i) {
        const Vec2f u = rng.uniform2();
        points[i].x = {2.0f * u.x - 1.0f, 2.0f * u.y - 1.0f, 1.0f};
        points[i].n = {0, 0, -1};
        points[i].wo = {0, 0, -1};
        points[i].albedo = {0.5f, 0.5f, 0.5f};
        targets[i] = Vec3f(0.5f + u.x, 0.5f, 0.2f + u.y);
      }
      field->train(points, targets, 0.05, 1.0);
    }
  }
  static Scene load(const std::string& filter) {
    const auto file =
        std::filesystem::temp_directory_path() / ("octrad_device_picture_" + std::to_string(::getpid()) + ".xml");
    std::ofstream(file)
        << R"(<scene version="3.0.0"><sensor type="perspective"><float name="fov" value="80"/><transform name="to_world">
      <lookat origin="0,0,-0.9" target="0,0,1" up="0,1,0"/></transform><film type="hdrfilm"><integer name="width" value="40"/><integer name="height" value="28"/>
      <rfilter type=")"
        << filter
        << R"("/></film></sensor><shape type="cube"><boolean name="flip_normals" value="true"/><bsdf type="diffuse"><rgb name="reflectance" value="0.6, 0.5, 0.4"/></bsdf></shape>
      <shape type="rectangle"><transform name="to_world"><scale value="0.3"/><rotate x="1" angle="90"/><translate y="0.99"/></transform>
      <emitter type="area"><rgb name="radiance" value="8"/></emitter></shape>
      <shape type="sphere"><float name="radius" value="0.3"/><point name="center" x="-0.4" y="0" z="0.2"/><bsdf type="roughconductor"><float name="alpha" value="0.1"/></bsdf></shape>
      <shape type="sphere"><float name="radius" value="0.3"/><point name="center" x="0.4" y="0" z="0.2"/><bsdf type="conductor"/></shape></scene>)";
    Scene scene = load_scene(file.string());
    std::filesystem::remove(file);
    return scene;
  }
  RenderOptions options(int spp) const {
    RenderOptions o;
    o.camera = scene.cameras.front();
    o.width = 40;
    o.height = 28;
    o.spp = spp;
    o.film = scene.film;
    o.max_depth = 6;
    o.seed = 5;
    return o;
  }
};

double difference(const Image& a, const Image& b, const char* channel) {
  const int c = a.channel(channel);
  double sum = 0.0, scale = 0.0;
  for (int y = 0; y < a.height; ++y) {
    for (int x = 0; x < a.width; ++x) {
      sum += static_cast<double>(std::abs(a.at(x, y, c) - b.at(x, y, c)));
      scale += static_cast<double>(std::abs(b.at(x, y, c)));
    }
  }
  return sum / (scale + 1e-9);
}

class RenderOnStream : public ::testing::TestWithParam<bool> {};

TEST_P(RenderOnStream, PathTracedPictureIsThatOfTheCpu) {
  const auto stream = testing::stream_or_skip(GetParam());
  if (!stream) GTEST_SKIP() << testing::kNoDevice;
  for (const char* filter : {"box", "gaussian", "tent"}) {
    Box box(filter);
    RenderOptions options = box.options(9);
    const RenderResult cpu = render_path(box.context, options);
    DeviceRenderer renderer(*stream, box.prepared, options, nullptr, box.config, "path", 0);
    const RenderResult device = renderer.render();
    EXPECT_EQ(device.spp, 9);
    EXPECT_EQ(device.samples, cpu.samples);
    ASSERT_EQ(device.image.width, cpu.image.width);
    ASSERT_EQ(device.image.height, cpu.image.height);
    for (const char* channel : {"R", "albedo.G", "normal.X", "depth.Z", "roughness.Y"}) {
      EXPECT_LT(difference(device.image, cpu.image, channel), stream->on_device() ? 2e-2 : 1e-5)
          << filter << " " << channel;
    }
    EXPECT_NEAR(static_cast<double>(device.counts.rays), static_cast<double>(cpu.counts.rays),
                1e-3 * static_cast<double>(cpu.counts.rays));
    // A crop is that part of the picture; little memory means many small jobs and the same picture.
    options.crop = {10, 5, 20, 11};
    DeviceRenderer part(*stream, box.prepared, options, nullptr, box.config, "path", 0);
    const Image crop = part.render().image;
    ASSERT_EQ(crop.width, 20);
    for (int x = 0; x < 20; ++x)
      EXPECT_NEAR(crop.at(x, 3, 0), device.image.at(x + 10, 8, 0), 1e-4f * (1.0f + crop.at(x, 3, 0)));
  }
}

TEST_P(RenderOnStream, CachedPicturesAreThoseOfTheCpu) {
  const auto stream = testing::stream_or_skip(GetParam());
  if (!stream) GTEST_SKIP() << testing::kNoDevice;
  Box box;
  const RenderOptions options = box.options(4);
  for (const auto& [name, mode] : {std::pair{"lhs", CacheMode::lhs}, std::pair{"rhs", CacheMode::rhs},
                                   std::pair{"deferred", CacheMode::deferred}}) {
    for (const DeltaSurfaces delta : {DeltaSurfaces::cache, DeltaSurfaces::trace}) {
      Config config = box.config;
      config.render_delta = delta;
      const RenderResult cpu =
          render(options, cache_integrator(box.context, *box.field, config, mode, 1, options.seed));
      DeviceRenderer renderer(*stream, box.prepared, options, box.field.get(), config, name, 0);
      const RenderResult device = renderer.render();
      for (const char* channel : {"R", "G", "B", "roughness.Y"}) {
        EXPECT_LT(difference(device.image, cpu.image, channel), stream->on_device() ? 2e-2 : 5e-3)
            << name << " " << get(config, "render.delta") << " " << channel;
      }
      EXPECT_EQ(device.counts.queries, cpu.counts.queries) << name << " " << get(config, "render.delta");
    }
  }
}

TEST_P(RenderOnStream, ViewsAreThoseOfTheCpu) {
  const auto stream = testing::stream_or_skip(GetParam());
  if (!stream) GTEST_SKIP() << testing::kNoDevice;
  Box box;
  RenderOptions options = box.options(2);
  for (const std::string& view : view_names(*box.field)) {
    for (const bool cropped : {false, true}) {
      options.crop = cropped ? Crop{10, 5, 20, 11} : Crop{};
      const RenderResult cpu = render_view(options, box.context, *box.field, box.config, view);
      DeviceRenderer renderer(*stream, box.prepared, options, box.field.get(), box.config, view, 0);
      const RenderResult device = renderer.render();
      ASSERT_EQ(device.image.width, cpu.image.width);
      EXPECT_EQ(device.spp, cpu.spp) << view;
      EXPECT_EQ(device.counts.queries, cpu.counts.queries) << view;
      for (const char* channel : {"R", "G", "B", "roughness.Y"}) {
        EXPECT_LT(difference(device.image, cpu.image, channel), stream->on_device() ? 3e-2 : 1e-2)
            << view << " " << channel;
      }
      double brightness = 0.0;
      for (int y = 0; y < cpu.image.height; ++y) {
        for (int x = 0; x < cpu.image.width; ++x) brightness += static_cast<double>(cpu.image.at(x, y, 0));
      }
      EXPECT_GT(brightness, 0.0) << view;
      EXPECT_THROW(renderer.time_frames(1), UsageError);
    }
  }
  EXPECT_THROW(DeviceRenderer(*stream, box.prepared, options, box.field.get(), box.config, "features9", 0), UsageError);
}

TEST_P(RenderOnStream, FramesAreTimedByStage) {
  const auto stream = testing::stream_or_skip(GetParam());
  if (!stream) GTEST_SKIP() << testing::kNoDevice;
  Box box;
  const RenderOptions options = box.options(1);
  DeviceRenderer renderer(*stream, box.prepared, options, box.field.get(), box.config, "lhs", 0);
  const FrameTimes times = renderer.time_frames(5);
  EXPECT_GT(times.median, 0.0);
  EXPECT_GE(times.p95, times.median);
  ASSERT_EQ(times.stages.size(), 4u);
  EXPECT_EQ(times.stages.front().first, "first hits");
  EXPECT_EQ(times.stages.back().first, "tone mapping");
}

TEST_P(RenderOnStream, LittleMemoryMeansSmallJobsAndThenAnError) {
  const auto stream = testing::stream_or_skip(GetParam());
  if (!stream) GTEST_SKIP() << testing::kNoDevice;
  Box box;
  const RenderOptions options = box.options(16);
  const std::size_t scene_and_film = 400'000;
  DeviceRenderer small(*stream, box.prepared, options, nullptr, box.config, "path", scene_and_film + 40 * 300);
  DeviceRenderer large(*stream, box.prepared, options, nullptr, box.config, "path", 0);
  EXPECT_LT(difference(small.render().image, large.render().image, "R"), 1e-6);
  EXPECT_THROW(DeviceRenderer(*stream, box.prepared, options, nullptr, box.config, "path", 1000), MemoryError);
}

INSTANTIATE_TEST_SUITE_P(All, RenderOnStream, ::testing::Values(false, true), testing::stream_name);

}  // namespace
}  // namespace octrad
