// What is measured while training is what `lhs` shows.
#include "octrad/train/validation.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "octrad/base/folder_test_helper.h"
#include "octrad/scene/load.h"
#include "octrad/transport/prepared_scene.h"

namespace octrad {
namespace {

// Radiance 1 everywhere; keeps what was asked.
class Ones : public TrainEngine {
 public:
  std::vector<SurfacePoint> asked;

  void radiance(std::span<const SurfacePoint> points, std::span<Vec3f> out) override {
    asked.assign(points.begin(), points.end());
    std::fill(out.begin(), out.end(), Vec3f(1.0f));
  }
  void step(long long, const ScheduleState&) override {}
  int steps_between_reports() const override { return 1; }
  StepReport collect() override { return {}; }
  RadianceField& field() override { throw std::logic_error("there is no field"); }
  std::unique_ptr<RadianceField> release_field() override { return nullptr; }
  RadianceField* trained() override { return nullptr; }
  void average(double) override {}
  std::vector<FarEnd> far_ends() override { return {}; }
  void set_far_ends(const std::vector<FarEnd>&) override {}
  GuideState guide() override { return {}; }
  void set_guide(const GuideState&) override {}
  void set_target_scale(float) override {}
  void scene_changed(std::unique_ptr<ChangedPoints>, double) override {}
  void last_batch(std::vector<SurfacePoint>&, std::vector<Vec3f>&) override {}
};

PreparedScene mirror_in_a_box() {
  TestFolder folder;
  return PreparedScene(load_scene(folder.write("mirror.xml", R"(<scene version="3.0.0">
    <sensor type="perspective"><transform name="to_world"><lookat origin="0,0,-0.9" target="0,0,1" up="0,1,0"/></transform>
    <film type="hdrfilm"><integer name="width" value="16"/><integer name="height" value="16"/></film></sensor>
    <shape type="cube"><boolean name="flip_normals" value="true"/><bsdf type="diffuse"/></shape>
    <shape type="sphere"><float name="radius" value="0.4"/><bsdf type="conductor"><string name="material" value="none"/>
    <rgb name="specular_reflectance" value="0.5"/></bsdf></shape></scene>)")));
}

// More pixels than are looked at at once, of errors that differ from part to part, some of which cannot be compared.
TEST(Validation, PartsAddUp) {
  const PreparedScene scene = mirror_in_a_box();
  const Config config = preset("cpu");
  Ones engine;
  for (const std::size_t usable : {std::size_t{160 * 120}, std::size_t{17000}, std::size_t{9000}}) {
    Image reference(160, 120, {"R", "G", "B"});
    for (std::size_t p = 0; p < 160 * 120; ++p) {
      const float value = p < usable ? 0.2f + static_cast<float>(p) / 5000.0f : std::nanf("");
      reference.set_rgb(static_cast<int>(p % 160), static_cast<int>(p / 160), Vec3f(value));
    }
    const double whole = Validation(scene.context(), reference, config, 1 << 20, 2).mape(engine);
    EXPECT_NEAR(Validation::mape_once(scene.context(), reference, config, 1 << 20, 2, engine), whole, 1e-9 * whole);
    EXPECT_GT(whole, 0.1);
  }
}

// Before training, not at the first measurement.
TEST(Validation, AReferenceWithoutAFinitePixelIsRefused) {
  const PreparedScene scene = mirror_in_a_box();
  Image reference(8, 8, {"R", "G", "B"});
  std::fill(reference.data.begin(), reference.data.end(), std::nanf(""));
  EXPECT_THROW(Validation(scene.context(), reference, preset("cpu"), 100, 1), InputError);
  reference.set_rgb(3, 3, Vec3f(1.0f));
  Ones engine;
  EXPECT_GE(Validation(scene.context(), reference, preset("cpu"), 100, 1).mape(engine), 0.0);
}

TEST(Validation, MirrorsAreFollowedAsInPictures) {
  const PreparedScene scene = mirror_in_a_box();
  Image reference(16, 16, {"R", "G", "B"});
  std::fill(reference.data.begin(), reference.data.end(), 1.0f);
  Config config = preset("cpu");
  Ones engine;
  const auto on_mirror = [&] {
    return std::count_if(engine.asked.begin(), engine.asked.end(), [](const SurfacePoint& p) { return p.alpha == 0; });
  };

  config.render_delta = DeltaSurfaces::cache;
  EXPECT_NEAR(Validation(scene.context(), reference, config, 1000, 1).mape(engine), 0.0, 1e-6);
  const double mirror = static_cast<double>(on_mirror()) / 256.0;
  EXPECT_GT(mirror, 0.1);

  config.render_delta = DeltaSurfaces::trace;  // the mirror reflects half of the wall behind it
  EXPECT_NEAR(Validation(scene.context(), reference, config, 1000, 1).mape(engine), mirror * 0.5 / 1.01, 1e-5);
  EXPECT_EQ(on_mirror(), 0);
}

}  // namespace
}  // namespace octrad
