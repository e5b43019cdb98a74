// Edits of a prepared scene are what the same scene is that was written so.
#include <gtest/gtest.h>

#include <string>

#include "octrad/base/error.h"
#include "octrad/base/folder_test_helper.h"
#include "octrad/device/stream_test_helper.h"
#include "octrad/scene/load.h"
#include "octrad/scene/sample_scenes.h"
#include "octrad/transport/checks.h"

namespace octrad {
namespace {

struct Written {
  std::string lamp = "4, 2, 1", globe = "1, 1, 1", point = "3, 3, 3", sky = "0.5, 0.5, 0.5", picture = "0.2";
  std::string diffuse = R"(<rgb name="reflectance" value="0.6, 0.5, 0.4"/>)";
  std::string plastic = R"(<float name="alpha" value="0.2"/><rgb name="diffuse_reflectance" value="0.1, 0.2, 0.3"/>)";
  std::string metal = R"(<float name="alpha" value="0.3"/>)";
  std::string principled = R"(<float name="roughness" value="0.4"/><rgb name="base_color" value="0.5, 0.5, 0.5"/>)";
};

PreparedScene load(const TestFolder& folder, const Written& w) {
  const std::string shape = R"(<shape type="rectangle"><transform name="to_world"><translate x=")";
  const auto panel = [&](int i, const std::string& id, const std::string& model, const std::string& inside) {
    return shape + std::to_string(3 * i) + R"("/></transform><bsdf type="twosided" id=")" + id + R"("><bsdf type=")" +
           model + "\">" + inside + "</bsdf></bsdf></shape>";
  };
  const std::string text =
      R"(<scene version="3.0.0"><sensor type="perspective"/>)" + panel(0, "d", "diffuse", w.diffuse) +
      panel(1, "p", "roughplastic", w.plastic) + panel(2, "m", "roughconductor", w.metal) +
      panel(3, "b", "principled", w.principled) + shape +
      R"(20"/></transform><emitter type="area"><rgb name="radiance" value=")" + w.lamp +
      R"("/></emitter></shape><shape type="sphere"><point name="center" x="0" y="9" z="0"/><emitter type="area"><rgb name="radiance" value=")" +
      w.globe + "\"/></emitter></shape>" + shape +
      R"(30"/></transform><emitter type="area"><texture type="checkerboard" name="radiance"><float name="color0" value=")" +
      w.picture +
      R"("/></texture></emitter></shape><emitter type="point"><point name="position" x="1" y="2" z="3"/><rgb name="intensity" value=")" +
      w.point + R"("/></emitter><emitter type="constant"><rgb name="radiance" value=")" + w.sky +
      "\"/></emitter></scene>";
  return PreparedScene(load_scene(folder.write("scene.xml", text)));
}

// Light and scattering as one scene has them are those of another, but for rounding.
void expect_same(const PreparedScene& a, const PreparedScene& b) {
  Rng rng(1, RngPurpose::test, 0);
  int lit = 0;
  for (int i = 0; i < 2000; ++i) {
    const Vec3f x{30.0f * rng.uniform(), 3.0f * rng.uniform(), 1.0f + rng.uniform()};
    const float pick = rng.uniform();
    const Vec2f u = rng.uniform2();
    const LightSample one = a.lights().sample(x, pick, u), other = b.lights().sample(x, pick, u);
    ASSERT_EQ(one.valid, other.valid);
    ASSERT_EQ(one.pdf, other.pdf);
    for (int c = 0; c < 3; ++c) ASSERT_NEAR(one.radiance[c], other.radiance[c], 1e-6f * other.radiance[c]);
    lit += one.valid && luminance(one.radiance) > 0.0f;
    const Vec3f direction = uniform_direction(rng.uniform2()), wi = uniform_direction(rng.uniform2());
    const Hit hit = a.tracer().intersect(x, direction, 0.0f, kRayInfinity);
    if (!hit.valid()) {
      EXPECT_EQ(a.lights().environment(direction), b.lights().environment(direction));
      continue;
    }
    const TransportContext ca = a.context(), cb = b.context();
    const SurfaceInteraction surface = ca.interact(hit, x, direction);
    const Vec3f ea = ca.emitted(surface, -direction), eb = cb.emitted(surface, -direction);
    for (int c = 0; c < 3; ++c) ASSERT_NEAR(ea[c], eb[c], 1e-6f * eb[c]);
    const ShadingPoint pa = ca.shade(surface, -direction), pb = cb.shade(surface, -direction);
    ASSERT_EQ(albedo_bsdf(pa.bsdf), albedo_bsdf(pb.bsdf));
    ASSERT_EQ(roughness_bsdf(pa.bsdf), roughness_bsdf(pb.bsdf));
    const Vec3f va = evaluate_bsdf(pa.bsdf, pa.to_local(pa.wo), pa.to_local(wi)).value,
                vb = evaluate_bsdf(pb.bsdf, pb.to_local(pb.wo), pb.to_local(wi)).value;
    for (int c = 0; c < 3; ++c) ASSERT_NEAR(va[c], vb[c], 1e-5f * vb[c]);
  }
  EXPECT_GT(lit, 300);
}

int material(const PreparedScene& scene, const std::string& id) {
  const auto& materials = scene.scene().materials;
  for (std::size_t i = 0; i < materials.size(); ++i) {
    if (materials[i].id == id) return static_cast<int>(i);
  }
  ADD_FAILURE() << "no material " << id;
  return 0;
}

TEST(SceneEdits, AreTheSceneThatWasWrittenSo) {
  TestFolder folder;
  PreparedScene scene = load(folder, {});
  const std::string fingerprint = scene.fingerprint();
  EXPECT_EQ(fingerprint, scene.scene().fingerprint);
  ASSERT_EQ(scene.light_count(), 5);
  Written other;
  other.lamp = "2, 1, 2";
  other.globe = "4, 4, 4";
  other.point = "0, 0, 0";
  other.sky = "1, 0.5, 0.25";
  other.diffuse = R"(<rgb name="reflectance" value="0.1, 0.9, 0.1"/>)";
  other.plastic = R"(<float name="alpha" value="0.5"/><rgb name="diffuse_reflectance" value="0.9, 0.2, 0.3"/>)";
  other.metal = R"(<float name="alpha" value="0.05"/><rgb name="specular_reflectance" value="0.5, 0.25, 1"/>)";
  other.principled = R"(<float name="roughness" value="0.9"/><rgb name="base_color" value="0.25, 0.5, 0.5"/>)";
  const SceneChange lamp = scene.set_light_factor(0, {0.5f, 0.5f, 2.0f});
  EXPECT_EQ(lamp.shapes, std::vector<int>{scene.scene().area_lights[0].shape});
  EXPECT_FALSE(lamp.materials);
  scene.set_light_factor(1, Vec3f(4.0f));
  EXPECT_EQ(scene.set_light_factor(3, Vec3f(0.0f)).lights.at(0), Vec3f(1, 2, 3));
  const SceneChange sky = scene.set_light_factor(4, {2.0f, 1.0f, 0.5f});
  EXPECT_TRUE(sky.shapes.empty() && sky.lights.empty());
  const SceneChange painted = scene.set_material_edit(material(scene, "d"), {Vec3f(0.1f, 0.9f, 0.1f), {}});
  EXPECT_TRUE(painted.materials);
  EXPECT_EQ(painted.shapes.size(), 1u);
  scene.set_material_edit(material(scene, "p"), {Vec3f(0.9f, 0.2f, 0.3f), 0.5f});
  scene.set_material_edit(material(scene, "m"), {Vec3f(0.5f, 0.25f, 1.0f), 0.05f});
  scene.set_material_edit(material(scene, "b"), {Vec3f(0.25f, 0.5f, 0.5f), 0.9f});
  EXPECT_NE(scene.fingerprint(), fingerprint);
  EXPECT_EQ(scene.fingerprint().size(), 16u);
  expect_same(scene, load(folder, other));

  // A picture as radiance is multiplied.
  PreparedScene original = load(folder, {});
  SurfaceInteraction surface;
  surface.emitter = 2;
  surface.shading_normal = {0, 0, 1};
  surface.uv = {0.1f, 0.1f};
  const Vec3f before = original.lights().emitted(surface, {0, 0, 1});
  EXPECT_FLOAT_EQ(before.x, 0.2f);
  original.set_light_factor(2, {3.0f, 2.0f, 1.0f});
  EXPECT_EQ(original.lights().emitted(surface, {0, 0, 1}), before * Vec3f(3.0f, 2.0f, 1.0f));

  // And all of it taken back.
  for (int i = 0; i < 5; ++i) scene.set_light_factor(i, Vec3f(1.0f));
  for (const char* id : {"d", "p", "m", "b"}) scene.set_material_edit(material(scene, id), {});
  EXPECT_EQ(scene.fingerprint(), fingerprint);
  expect_same(scene, load(folder, {}));
}

class SceneEditsOnDevices : public testing::StreamTest {};

TEST_P(SceneEditsOnDevices, ReachTheCopy) {
  PreparedScene scene(testing::every_material(), PreparedScene::CpuTree::bvh8);
  scene.world(*stream);
  const LightsView& lights = scene.lights().view();
  for (int i = 0; i < lights.area_count + lights.delta_count; ++i) scene.set_light_factor(i, {2.0f, 1.0f, 0.25f});
  if (lights.has_environment()) {
    EXPECT_THROW(scene.set_light_factor(scene.light_count() - 1, Vec3f(2.0f)), InputError);
  }
  for (std::size_t i = 0; i < scene.scene().materials.size(); ++i)
    scene.set_material_edit(static_cast<int>(i), {Vec3f(0.3f, 0.2f, 0.1f), 0.35f});
  EXPECT_TRUE(testing::passed(check_world(*stream, scene, 6000, 64)));
}

INSTANTIATE_TEST_SUITE_P(All, SceneEditsOnDevices, ::testing::Bool(), testing::stream_name);

}  // namespace
}  // namespace octrad
