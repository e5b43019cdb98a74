#include "octrad/transport/light_weights.h"

#include <gtest/gtest.h>

#include <numeric>

#include "octrad/base/sanitized_test_helper.h"
#include "octrad/scene/sample_scenes.h"
#include "octrad/transport/lhs_sampler.h"
#include "octrad/transport/mean_test_helper.h"
#include "octrad/transport/path.h"
#include "octrad/transport/prepared_scene.h"
#include "octrad/transport/rhs_estimator.h"

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

// What `measure` finds in a scene whose lights are not measured.
template <typename Measure>
auto found_in(const Scene& scene, Measure measure) {
  const auto tracer = make_embree_tracer(scene);
  const Materials materials(scene);
  const Lights lights(scene);
  return measure(TransportContext{scene, *tracer, materials, lights});
}

std::vector<float> weights_of(const Scene& scene) {
  const std::vector<float> weights = found_in(scene, light_weights);
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

// A box around the sensor, with a window towards -z, under a sky that is alike everywhere. A rough mirror may face the
// window.
class Window : public SceneMaker {
 public:
  explicit Window(float radiance = 1.0f, bool mirror = false) {
    const int grey = diffuse(Vec3f(0.5f));
    quad({-2, -2, 2}, {4, 0, 0}, {0, 0, -4}, grey);                                     // floor
    quad({-2, 2, -2}, {4, 0, 0}, {0, 0, 4}, grey);                                      // ceiling
    quad({-2, -2, 2}, {0, 0, -4}, {0, 4, 0}, grey);                                     // left
    quad({2, -2, -2}, {0, 0, 4}, {0, 4, 0}, grey);                                      // right
    quad({2, -2, 2}, {-4, 0, 0}, {0, 4, 0}, mirror ? rough_metal(0.3f) : grey);         // behind
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

std::optional<EnvironmentPlaces> places_of(const Scene& scene) { return found_in(scene, environment_places); }

// Solid-angle density from `p` along `direction`, over that of all directions alike.
float density(const EnvironmentMap& map, Vec3f p, Vec3f direction) {
  return map.pdf(p, normalize(direction)) * 4.0f * kPi;
}

TEST(EnvironmentPlaces, DirectionsThroughWindowsAreDrawnMoreOftenThanThoseOfWalls) {
  for (const float unit : {1e-3f, 1.0f, 1e5f}) {
    const Window window(unit);
    const auto places = places_of(window.scene);
    ASSERT_TRUE(places);
    EnvironmentMap map(window.scene.environments[0]);
    map.set_places(*places);
    for (const Vec3f p : {Vec3f(0, 0, 1.9f), Vec3f(0.1f, -1.9f, 1.0f)})
      EXPECT_GT(density(map, p, Vec3f(0, 0, -1.99f) - p), 3.0f) << unit;
    for (const Vec3f p : {Vec3f(0, 0, 1.9f), Vec3f(1.9f, 0, 0), Vec3f(0.1f, -1.9f, 1.0f)}) {
      for (const Vec3f blind : {Vec3f(0, 1, 0.01f), Vec3f(0, -1, 0.01f), Vec3f(0, 0, 1), Vec3f(1, 0, 0.1f)}) {
        EXPECT_GT(density(map, p, blind), 0.9f * static_cast<float>(kUniformPicks)) << unit;
        EXPECT_LT(density(map, p, blind), 0.5f) << unit;
      }
    }
    // From the left the window is seen to the right, and the other way round.
    const Vec3f left(-1.9f, 0, -1), right(1.9f, 0, -1), to_right(0.86f, 0, -0.5f), to_left(-0.86f, 0, -0.5f);
    EXPECT_GT(density(map, left, to_right), 1.5f * density(map, left, to_left)) << unit;
    EXPECT_GT(density(map, right, to_left), 1.5f * density(map, right, to_right)) << unit;
  }
}

TEST(EnvironmentPlaces, ThereAreNoneWhereNothingIsToBeMeasured) {
  Window window;
  window.scene.cameras.clear();
  EXPECT_FALSE(places_of(window.scene));
  EXPECT_FALSE(places_of(Window(0.0f).scene));
  Window constant;
  constant.scene.environments[0].width = constant.scene.environments[0].height = 1;
  constant.scene.environments[0].pixels.resize(1);
  EXPECT_FALSE(places_of(constant.scene));
  EXPECT_FALSE(places_of(Lamps({{0, 2, 0}}).scene));
}

TEST(EnvironmentPlaces, AScenePreparesThemUnlessItsFileHasSamplingWeights) {
  Window window;
  const EnvironmentMap plain(window.scene.environments[0]);
  EnvironmentMap measured(window.scene.environments[0]);
  measured.set_places(places_of(window.scene).value());
  const Vec3f p(0, 0, 1.9f), through = normalize(Vec3f(0.1f, 0.1f, -1));
  EXPECT_EQ(PreparedScene(window.scene).lights().environment_pdf(p, through), measured.pdf(p, through));
  window.scene.environments[0].sampling_weight = 1.0f;
  EXPECT_EQ(PreparedScene(window.scene).lights().environment_pdf(p, through), plain.pdf(p, through));
}

// The mean of `estimates` of a scene whose places are measured and of one whose parts are alike everywhere. Densities
// that were asked for another place than that of the sample would make them differ.
template <typename Estimates>
void expect_unbiased(const Window& window, Estimates estimates) {
  Scene plain = window.scene;
  plain.environments[0].sampling_weight = 1.0f;
  const PreparedScene measured(window.scene), alike(plain);
  const Vec3f p(-1.9f, 0, -1), q(1.9f, 0, -1), d(0.86f, 0, -0.5f);
  ASSERT_GT(measured.lights().environment_pdf(p, d), 1.5f * measured.lights().environment_pdf(q, d));
  ASSERT_EQ(alike.lights().environment_pdf(p, d), alike.lights().environment_pdf(q, d));
  const std::vector<Vec3f> found = estimates(measured), expected = estimates(alike);
  std::vector<Vec3f> differences;  // pairs have the same points or seeds
  for (std::size_t i = 0; i < found.size(); ++i) differences.push_back(found[i] - expected[i]);
  const testing::Mean difference = testing::mean(differences);
  EXPECT_LT(difference.error, 0.01 * testing::mean(expected).value) << "too noisy to see anything";
  EXPECT_NEAR(difference.value, 0.0, 4.0 * difference.error);
}

TEST(EnvironmentPlaces, PathsStayUnbiased) {
  if (testing::sanitized()) GTEST_SKIP() << "statistics of many samples; others draw some under the sanitizers";
  for (const Vec3f target : {Vec3f(-2, 0.5f, -1), Vec3f(2, 0.5f, -1), Vec3f(0.5f, -2, 1)}) {
    expect_unbiased(Window(), [&](const PreparedScene& scene) {
      const Ray ray{Vec3f(0.0f), normalize(target), 1e30f};
      std::vector<PathSample> paths;
      for (std::uint64_t i = 0; i < 200000; ++i) paths.push_back({ray, Rng(1, RngPurpose::test, i), {}, {}});
      PathCounters counters;
      trace_paths(scene.context(), {2, 5}, paths, counters);
      std::vector<Vec3f> radiance;
      for (const PathSample& path : paths) radiance.push_back(path.radiance);
      return radiance;
    });
  }
}

TEST(EnvironmentPlaces, RightHandSidesStayUnbiasedAlsoBehindMirrors) {
  if (testing::sanitized()) GTEST_SKIP() << "statistics of many samples; others draw some under the sanitizers";
  for (const bool mirror : {false, true}) {
    expect_unbiased(Window(1.0f, mirror), [&](const PreparedScene& scene) {
      LhsOptions where;
      where.walks = 0.0;
      std::vector<ShadingPoint> points(8192);
      LhsSampler(scene, where).sample(0, points);
      // Rays pass the mirror itself, as they do near mirrors: rough enough for light samples to matter there.
      std::erase_if(points, [](const ShadingPoint& p) { return is_followed(p.bsdf, 0.4f); });
      RhsOptions options;
      options.directions = mirror ? 128 : 32;
      options.follow_below = 0.4f;
      std::vector<Vec3f> targets(points.size());
      estimate_rhs(scene.context(), points, options, nullptr, targets);
      return targets;
    });
  }
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
