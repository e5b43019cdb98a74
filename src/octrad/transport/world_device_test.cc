// A scene in a stream's memory against the same scene on the CPU: rays, and what is said where they end.
#include <gtest/gtest.h>

#include <filesystem>
#include <type_traits>

#include "octrad/device/stream_test_helper.h"
#include "octrad/scene/files_test_helper.h"
#include "octrad/scene/load.h"
#include "octrad/scene/sample_scenes.h"
#include "octrad/transport/checks.h"

namespace octrad {
namespace {

static_assert(std::is_trivially_copyable_v<DeviceWorld> && std::is_trivially_copyable_v<ShadingPoint>);

using Traversal = RayBatch::Traversal;

class DeviceWorlds : public testing::StreamTest {
 protected:
  void expect_the_cpus(Scene made, std::size_t n) {
    const PreparedScene scene(std::move(made), PreparedScene::CpuTree::bvh8);
    const std::size_t before = stream->allocated_bytes(), bytes = scene.bytes_to_upload(*stream);
    EXPECT_GE(bytes, scene.bvh8().bytes());
    scene.world(*stream);
    EXPECT_EQ(stream->allocated_bytes() - before, bytes);
    EXPECT_TRUE(testing::passed(check_world(*stream, scene, n, 61)));
    for (const Traversal traversal : {Traversal::warps, Traversal::threads}) {
      EXPECT_TRUE(testing::passed(check_closest(*stream, scene, incoherent_rays(scene, n, false, 62), traversal)));
      EXPECT_TRUE(testing::passed(check_occluded(*stream, scene, incoherent_rays(scene, n, true, 63), traversal)));
    }
  }
};

TEST_P(DeviceWorlds, SayWhatTheCpuSays) { expect_the_cpus(testing::every_material(), 6000); }

// The scene does what it is for.
TEST(SampleScenes, EveryMaterialIsSeen) {
  const PreparedScene scene(testing::every_material(), PreparedScene::CpuTree::bvh8);
  const TransportContext context = scene.context();
  int textured = 0, bumped = 0, masked = 0, coats = 0, lit = 0, environment = 0;
  Rng rng(1, RngPurpose::test, 0);
  for (const RayQuery& ray : incoherent_rays(scene, 6000, false, 61)) {
    const Hit hit = context.intersect(ray.origin, ray.direction, 0.0f, ray.t_max);
    if (!hit.valid()) continue;
    const ShadingPoint point = context.shade(context.interact(hit, ray.origin, ray.direction), -ray.direction);
    const LightSample light = context.sample_light(point.surface.position, rng.uniform(), rng.uniform2());
    textured += scene.materials().view().records[point.surface.material].textured != 0;
    bumped += point.bsdf.bumped;
    masked += point.bsdf.opacity < 1.0f;
    coats += point.bsdf.external_transmittance != nullptr;
    if (light.valid) ++(light.distance == kEnvironmentDistance ? environment : lit);
  }
  EXPECT_GT(textured, 1000);
  EXPECT_GT(bumped, 300);
  EXPECT_GT(masked, 100);
  EXPECT_GT(coats, 300);
  EXPECT_GT(lit, 500);
  EXPECT_GT(environment, 500);
}

TEST_P(DeviceWorlds, WithoutLightsAndWithFlatEnvironments) {
  testing::SceneMaker maker;
  maker.quad({0, 0, 0}, {1, 0, 0}, {0, 1, 0}, maker.diffuse(Vec3f(0.5f)));
  expect_the_cpus(maker.scene, 500);
  Environment sky;
  sky.width = sky.height = 1;
  sky.pixels = {{1, 2, 3}};
  maker.scene.environments = {sky};
  expect_the_cpus(maker.scene, 500);
  sky.width = 3;
  sky.pixels = {{1, 2, 3}, {0, 1, 0}, {5, 4, 3}};
  maker.scene.environments = {sky};
  expect_the_cpus(maker.scene, 500);
}

TEST_P(DeviceWorlds, OfTheRepository) {
  for (const char* name : {"cornell-box", "furnace", "glossy-room"}) {
    SCOPED_TRACE(name);
    expect_the_cpus(load_scene(std::string("scenes/") + name + "/scene.xml"), 3000);
  }
}

TEST_P(DeviceWorlds, Shared) {
  int found = 0;
  for (const char* name : {"cbox-mitsuba", "bathroom", "kitchen", "living-room", "veach-ajar"}) {
    const std::filesystem::path file = shared_folder() / "scenes" / name / "scene.xml";
    if (!std::filesystem::exists(file)) continue;
    SCOPED_TRACE(name);
    ++found;
    expect_the_cpus(load_scene(file.string()), 3000);
  }
  if (found == 0) GTEST_SKIP() << "no shared scenes in " << shared_folder();
}

INSTANTIATE_TEST_SUITE_P(All, DeviceWorlds, ::testing::Bool(), testing::stream_name);

}  // namespace
}  // namespace octrad
