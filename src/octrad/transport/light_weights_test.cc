#include "octrad/transport/light_weights.h"

#include <gtest/gtest.h>

#include <numeric>

#include "octrad/scene/sample_scenes.h"
#include "octrad/transport/prepared_scene.h"

namespace octrad {
namespace {

using testing::SceneMaker;

// A floor seen from above, and lamps of one size above it.
class Lamps : public SceneMaker {
 public:
  explicit Lamps(const std::vector<Vec3f>& places, float radiance = 10.0f) {
    const int grey = diffuse(Vec3f(0.5f));
    quad({-10, 0, 10}, {20, 0, 0}, {0, 0, -20}, grey);
    for (const Vec3f& p : places) sphere(p, 0.1f, grey, Vec3f(radiance));
    scene.cameras = {look_at({0, 8, 0.1f}, {0, 0, 0}, {0, 1, 0}, 90.0f, Camera::FovAxis::x)};
    scene.cameras[0].film_width = scene.cameras[0].film_height = 16;
  }
};

std::vector<float> weights_of(const Scene& scene) {
  const auto tracer = make_embree_tracer(scene);
  const Materials materials(scene);
  const Lights lights(scene);
  const std::vector<float> weights = light_weights({scene, *tracer, materials, lights});
  EXPECT_NEAR(std::accumulate(weights.begin(), weights.end(), 0.0), 1.0, 1e-5);
  return weights;
}

TEST(LightWeights, EqualLampsAreAlikeAndHiddenOnesKeepTheirPartOfTheUniform) {
  Lamps lamps({{-3, 2, 0}, {3, 2, 0}, {0, -5, 0}, {0, 2, 0}});
  lamps.sphere({0, 2, 0}, 0.2f, lamps.diffuse(Vec3f(0.5f)));  // around the last one
  const std::vector<float> w = weights_of(lamps.scene);
  EXPECT_NEAR(w[0], w[1], 0.1f * w[0]);
  const auto least = static_cast<float>(kUniformPicks) / 4.0f;
  for (const int hidden : {2, 3}) {
    EXPECT_GE(w[static_cast<std::size_t>(hidden)], least);
    EXPECT_LT(w[static_cast<std::size_t>(hidden)], 1.1f * least);
  }
}

TEST(LightWeights, BrightLampsAreLikelierWhateverTheUnitOfRadiance) {
  for (const float unit : {1e-3f, 1.0f, 1e5f}) {
    Lamps lamps({{-1, 2, 0}, {1, 2, 0}}, unit);
    lamps.scene.textures[static_cast<std::size_t>(lamps.scene.area_lights[0].radiance)].color0 = Vec3f(20.0f * unit);
    const std::vector<float> w = weights_of(lamps.scene);
    EXPECT_GT(w[0], 0.75f) << unit;
    EXPECT_LT(w[0], 0.9f) << unit;
  }
}

TEST(LightWeights, ManyLampsAreSampledInTurns) {
  std::vector<Vec3f> places;
  for (int i = 0; i < 400; ++i)
    places.push_back({static_cast<float>(i % 20) - 9.5f, 2.0f, static_cast<float>(i / 20) - 9.5f});
  places.push_back({0.2f, 3.0f, 0.2f});
  Lamps lamps(places, 1.0f);
  lamps.scene.textures.push_back(lamps.scene.textures[static_cast<std::size_t>(lamps.scene.area_lights[0].radiance)]);
  lamps.scene.textures.back().color0 = Vec3f(400.0f);
  lamps.scene.area_lights.back().radiance = static_cast<int>(lamps.scene.textures.size()) - 1;
  const std::vector<float> w = weights_of(lamps.scene);
  const auto least = static_cast<float>(kUniformPicks) / 401.0f;
  for (const float weight : w) EXPECT_GE(weight, least);
  EXPECT_GT(w.back(), 8.0f / 401.0f);
}

TEST(LightWeights, WithoutSensorsOrLightAllAreAlike) {
  Lamps lamps({{-3, 2, 0}, {3, 2, 0}});
  lamps.scene.cameras.clear();
  EXPECT_EQ(weights_of(lamps.scene), (std::vector<float>{0.5f, 0.5f}));
  EXPECT_EQ(weights_of(Lamps({{-3, -2, 0}, {3, -2, 0}}).scene), (std::vector<float>{0.5f, 0.5f}));
  EXPECT_EQ(weights_of(Lamps({{0, 2, 0}}).scene), std::vector<float>{1.0f});
}

// A box around the sensor, with a window towards -z, under a sky that is alike everywhere.
class Window : public SceneMaker {
 public:
  explicit Window(float radiance = 1.0f) {
    const int grey = diffuse(Vec3f(0.5f));
    quad({-2, -2, 2}, {4, 0, 0}, {0, 0, -4}, grey);                                     // floor
    quad({-2, 2, -2}, {4, 0, 0}, {0, 0, 4}, grey);                                      // ceiling
    quad({-2, -2, 2}, {0, 0, -4}, {0, 4, 0}, grey);                                     // left
    quad({2, -2, -2}, {0, 0, 4}, {0, 4, 0}, grey);                                      // right
    quad({2, -2, 2}, {-4, 0, 0}, {0, 4, 0}, grey);                                      // behind
    for (const float x : {-2.0f, 1.0f}) quad({x, -2, -2}, {1, 0, 0}, {0, 4, 0}, grey);  // beside the window
    for (const float y : {-2.0f, 1.0f}) quad({-1, y, -2}, {2, 0, 0}, {0, 1, 0}, grey);  // below and above it
    Environment sky;
    sky.width = 32;
    sky.height = 17;
    sky.pixels.assign(32 * 17, Vec3f(radiance));
    scene.environments = {sky};
    scene.cameras = {look_at({0, 0, 0}, {0, 0, 1}, {0, 1, 0}, 90.0f, Camera::FovAxis::x)};
    scene.cameras[0].film_width = scene.cameras[0].film_height = 16;
  }
};

std::vector<float> factors_of(const Scene& scene) {
  const auto tracer = make_embree_tracer(scene);
  const Materials materials(scene);
  const Lights lights(scene);
  return environment_factors({scene, *tracer, materials, lights});
}

TEST(EnvironmentFactors, DirectionsThroughWindowsAreDrawnMoreOftenThanThoseOfWalls) {
  for (const float unit : {1e-3f, 1.0f, 1e5f}) {
    const Window window(unit);
    const std::vector<float> factors = factors_of(window.scene);
    ASSERT_EQ(factors.size(), static_cast<std::size_t>(kEnvironmentParts));
    const Lights lights(window.scene);
    const auto factor = [&](Vec3f direction) {
      return factors[static_cast<std::size_t>(environment_part(lights.view().environment, normalize(direction)))];
    };
    EXPECT_GT(factor({0.05f, 0.05f, -1}), 1.5f) << unit;
    EXPECT_GT(factor({-0.05f, -0.05f, -1}), 1.5f) << unit;
    for (const Vec3f blind : {Vec3f(0, 1, 0), Vec3f(0, -1, 0), Vec3f(0, 0, 1), Vec3f(1, 0, 0.1f), Vec3f(-1, 0, 0.1f)}) {
      EXPECT_GE(factor(blind), static_cast<float>(kUniformPicks)) << unit;
      EXPECT_LT(factor(blind), 0.4f) << unit;
    }
  }
}

TEST(EnvironmentFactors, ThereAreNoneWhereNothingIsToBeMeasured) {
  Window window;
  window.scene.cameras.clear();
  EXPECT_TRUE(factors_of(window.scene).empty());
  Window dark(0.0f);
  EXPECT_TRUE(factors_of(dark.scene).empty());
  Window constant;
  constant.scene.environments[0].width = constant.scene.environments[0].height = 1;
  constant.scene.environments[0].pixels.resize(1);
  EXPECT_TRUE(factors_of(constant.scene).empty());
  EXPECT_TRUE(factors_of(Lamps({{0, 2, 0}}).scene).empty());
}

TEST(EnvironmentFactors, AScenePreparesThemUnlessItsFileHasSamplingWeights) {
  Window window;
  const std::vector<float> factors = factors_of(window.scene);
  const auto prepared = [](const Scene& scene) {
    const PreparedScene p(scene);
    const float* f = p.lights().view().environment.factors;
    return std::vector<float>(f, f + kEnvironmentParts);
  };
  EXPECT_EQ(prepared(window.scene), factors);
  window.scene.environments[0].sampling_weight = 1.0f;
  EXPECT_EQ(prepared(window.scene), std::vector<float>(kEnvironmentParts, 1.0f));
}

TEST(LightWeights, AScenePreparesThemUnlessItsFileHasSome) {
  Lamps lamps({{-3, 2, 0}, {3, 2, 0}, {0, -5, 0}});
  const std::vector<float> w = weights_of(lamps.scene);
  PreparedScene measured(lamps.scene);
  for (int i = 0; i < 3; ++i)
    EXPECT_NEAR(light_pick(measured.lights().view(), i), w[static_cast<std::size_t>(i)], 1e-6f);
  PreparedScene dark(lamps.scene);  // edits do not change them, nor does it matter which comes first
  dark.set_light_factor(0, Vec3f(0.0f));
  EXPECT_EQ(light_pick(dark.lights().view(), 0), light_pick(measured.lights().view(), 0));
  PreparedScene painted(lamps.scene);
  MaterialEdit black;
  black.color = Vec3f(0.0f);
  for (int m = 0; m < static_cast<int>(lamps.scene.materials.size()); ++m) painted.set_material_edit(m, black);
  EXPECT_EQ(light_pick(painted.lights().view(), 0), light_pick(measured.lights().view(), 0));
  lamps.scene.area_lights[2].sampling_weight = 2.0f;
  EXPECT_FLOAT_EQ(light_pick(PreparedScene(lamps.scene).lights().view(), 2), 0.5f);
}

}  // namespace
}  // namespace octrad
