#include "octrad/shading/lights.h"

#include <gtest/gtest.h>

#include <numeric>

#include "octrad/base/sanitized_test_helper.h"
#include "octrad/geometry/tracer.h"
#include "octrad/scene/sample_scenes.h"
#include "octrad/shading/chi_square_test_helper.h"
#include "octrad/shading/environment_map.h"

namespace octrad {
namespace {

using testing::SceneMaker;

Environment speckled_environment(int width, int height) {
  Environment e;
  e.width = width;
  e.height = height;
  Rng rng(3, RngPurpose::test, 7);
  for (int i = 0; i < width * height; ++i) {
    const float v = rng.uniform();
    e.pixels.push_back(Vec3f(v * v * v * 8.0f, v, 1.0f - v));
  }
  const float c = std::cos(0.7f), s = std::sin(0.7f);
  const float m[9] = {c, -s, 0, s, c, 0, 0, 0, 1};
  std::copy(m, m + 9, e.to_world);
  return e;
}

// For 2 x 2 x 2 places of the unit cube. The expected numbers of samples below are integrals that jumps spoil, so
// shares are alike within a factor of 3.
EnvironmentPlaces speckled_places() {
  EnvironmentPlaces places{PlaceGrid({{0, 0, 0}, {1, 1, 1}}, 2), {}};
  Rng rng(4, RngPurpose::test, 7);
  for (int i = 0; i < 8 * kEnvironmentParts; ++i) places.shares.push_back(1.0f + 2.0f * rng.uniform());
  return places;
}

void expect_density_of_samples(const EnvironmentMap& map, Vec3f p, std::uint64_t seed) {
  int elsewhere = 0;
  const auto result = testing::chi_square(
      [&](Rng& rng, Vec3f& w) {
        const EnvironmentMap::Sample s = map.sample(p, rng.uniform2());
        w = s.direction;
        if (s.pdf > 0.0f) {
          EXPECT_NEAR(length(w), 1.0f, 1e-5f);
          float density = 0.0f;
          EXPECT_NEAR(map.radiance(p, w, density).y, s.radiance.y, 2e-3f);
          EXPECT_NEAR(map.radiance(w).x, map.radiance(p, w, density).x, 1e-4f);
          EXPECT_EQ(density, map.pdf(p, w));
          elsewhere += std::fabs(s.pdf - density) > 2e-3f * s.pdf + 1e-5f;
        }
        return s.pdf > 0.0f;
      },
      [&](Vec3f w) { return static_cast<double>(map.pdf(p, w)); }, 200000, seed);
  EXPECT_GT(result.p_value, 0.001) << result.text;
  EXPECT_NEAR(result.integral, 1.0, 0.01);
  EXPECT_LE(elsewhere, 4) << "samples that rounding puts across the border of a part";
}

TEST(EnvironmentMap, SamplesFollowTheirDensity) {
  if (testing::sanitized()) GTEST_SKIP() << "statistics of many samples; others draw some under the sanitizers";
  for (const auto& [width, height] : {std::pair{16, 9}, {64, 32}, {5, 3}, {1, 2}, {1, 1}}) {
    const Environment e = speckled_environment(width, height);
    EnvironmentMap map(e);
    expect_density_of_samples(map, Vec3f(0.3f), static_cast<std::uint64_t>(width));
    map.set_places(speckled_places());
    for (const float at : {0.3f, 0.7f}) expect_density_of_samples(map, Vec3f(at), static_cast<std::uint64_t>(width));
  }
}

TEST(EnvironmentMap, PlacesSayHowOftenPartsAreDrawn) {
  Environment e;
  e.width = 64;
  e.height = 33;
  e.pixels.assign(64 * 33, Vec3f(1.0f));
  EnvironmentMap map(e);
  const auto share_of = [&map](Vec3f p, int part) {
    Rng rng(1, RngPurpose::test, 5);
    int inside = 0;
    for (int i = 0; i < 100000; ++i)
      inside += environment_part(map.view(), map.sample(p, rng.uniform2()).direction) == part;
    return inside / 100000.0;
  };
  const std::vector<float> integrals = map.integrals();
  ASSERT_EQ(integrals.size(), static_cast<std::size_t>(kEnvironmentParts));
  const double total = std::accumulate(integrals.begin(), integrals.end(), 0.0);
  EXPECT_NEAR(total, 2.0 / static_cast<double>(kPi), 1e-3);  // the mean of sin(theta) over (u, v)
  const int part = 4 * kEnvironmentColumns + 3;
  EXPECT_NEAR(share_of(Vec3f(0.0f), part), static_cast<double>(integrals[part]) / total, 0.002);
  // Place 0 draws nothing else, place 1 (upper z) as before.
  EnvironmentPlaces places{PlaceGrid({{-1, -1, -1}, {1, 1, 1}}, 2), {}};
  for (int i = 0; i < 8; ++i) places.shares.insert(places.shares.end(), integrals.begin(), integrals.end());
  for (int i = 0; i < kEnvironmentParts; ++i) places.shares[static_cast<std::size_t>(i)] = i == part ? 3.0f : 0.0f;
  map.set_places(places);
  for (const float beyond : {0.5f, 9.0f}) {  // outside of the box as at its border
    EXPECT_GT(share_of(Vec3f(-beyond), part), 0.999);
    EXPECT_NEAR(share_of({-beyond, -beyond, beyond}, part), static_cast<double>(integrals[part]) / total, 0.002);
  }
  // Estimates of what the map radiates do not change: 4 pi.
  map.set_places(speckled_places());
  for (const auto& p : {Vec3f(0.2f), Vec3f(0.2f, 0.2f, 0.7f), Vec3f(0.8f)}) {
    Rng rng(2, RngPurpose::test, 5);
    double sum = 0.0;
    for (int i = 0; i < 100000; ++i) {
      const float pdf = map.sample(p, rng.uniform2()).pdf;
      if (pdf > 0.0f) sum += 1.0 / static_cast<double>(pdf);  // at the poles themselves there is none
    }
    EXPECT_NEAR(sum / 100000.0, 4.0 * static_cast<double>(kPi), 0.1);
  }
}

// Stretched and sheared skies: densities per solid angle of the world.
TEST(EnvironmentMap, AnyLinearMapKeepsDensitiesTrue) {
  Environment e = speckled_environment(16, 9);
  const float m[9] = {1.0f, 0.4f, 0.0f, 0.0f, 0.6f, 0.1f, -0.2f, 0.0f, 0.5f};
  std::copy(m, m + 9, e.to_world);
  EnvironmentMap map(e);
  expect_density_of_samples(map, Vec3f(0.3f), 5);
  map.set_places(speckled_places());
  expect_density_of_samples(map, Vec3f(0.7f), 5);
  // The radiance towards M d is that of the map towards d.
  Environment plain = e;
  const float one[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};
  std::copy(one, one + 9, plain.to_world);
  const Vec3f d = normalize(Vec3f(0.3f, 0.5f, -0.7f));
  const Vec3f world = normalize(Vec3f(m[0] * d.x + m[1] * d.y + m[2] * d.z, m[3] * d.x + m[4] * d.y + m[5] * d.z,
                                      m[6] * d.x + m[7] * d.y + m[8] * d.z));
  EXPECT_NEAR(map.radiance(world).x, EnvironmentMap(plain).radiance(d).x, 1e-4f);
}

TEST(EnvironmentMap, ConstantIsConstantAndBlackIsHarmless) {
  Environment e;
  e.width = e.height = 64;
  e.pixels.assign(64 * 64, Vec3f(2.0f, 3.0f, 4.0f));
  const EnvironmentMap map(e);
  EXPECT_NEAR(map.pdf(Vec3f(0.0f), normalize(Vec3f(0.3f, 0.1f, -0.6f))) * 4.0f * kPi, 1.0f, 1e-3f);
  EXPECT_EQ(map.radiance({0, 1, 0}), Vec3f(2.0f, 3.0f, 4.0f));
  Environment black = e;
  black.pixels.assign(64 * 64, Vec3f(0.0f));
  EXPECT_EQ(EnvironmentMap(black).sample(Vec3f(0.0f), {0.5f, 0.5f}).pdf, 0.0f);
  EXPECT_EQ(EnvironmentMap(black).pdf(Vec3f(0.0f), {0, 0, 1}), 0.0f);
}

struct Estimate {
  double mean = 0.0, error = 0.0;
};

// Irradiance at x with normal n by light sampling, and its standard error.
Estimate irradiance(const Scene& scene, Vec3f x, Vec3f n, int samples) {
  const Lights lights(scene);
  Rng rng(9, RngPurpose::test, 3);
  double sum = 0.0, squares = 0.0;
  for (int i = 0; i < samples; ++i) {
    const float pick = rng.uniform();
    const LightSample s = lights.sample(x, pick, rng.uniform2());
    if (!s.valid) continue;
    const auto value = static_cast<double>(s.radiance.x * std::fmax(0.0f, dot(n, s.direction)) / s.pdf);
    sum += value;
    squares += value * value;
  }
  const double mean = sum / samples;
  return {mean, std::sqrt(std::fmax(0.0, squares / samples - mean * mean) / samples)};
}

// Within 4 standard errors, and what float arithmetic loses.
void expect_irradiance(const Estimate& found, double expected) {
  EXPECT_NEAR(found.mean, expected, 4.0 * found.error + 1e-5 * expected);
}

TEST(Lights, SphereIrradianceIsAnalytic) {
  // Seen fully above the horizon: E = pi L (r / d)^2 cos.
  SceneMaker maker;
  const int grey = maker.diffuse(Vec3f(0.5f));
  maker.sphere({0.0f, 3.0f, 4.0f}, 1.0f, grey, Vec3f(2.0f));
  expect_irradiance(irradiance(maker.scene, {0, 0, 0}, {0, 0, 1}, 4000), 3.14159265 * 2.0 / 25.0 * 0.8);
  // From inside a sphere that emits inwards the irradiance is pi L everywhere.
  SceneMaker inward;
  inward.sphere({1.0f, 0.0f, 0.0f}, 2.0f, inward.diffuse(Vec3f(0.5f)), Vec3f(3.0f), true);
  expect_irradiance(irradiance(inward.scene, {0.2f, 0.3f, 0.1f}, {0, 0, 1}, 200000), 3.14159265 * 3.0);
  // Nothing from the wrong side.
  EXPECT_EQ(irradiance(inward.scene, {10, 0, 0}, {-1, 0, 0}, 100).mean, 0.0);
}

TEST(Lights, RectangleIrradianceIsAnalytic) {
  // A square of side 2a at height h above the point, facing it: the view factor of a parallel plate from four corners.
  SceneMaker maker;
  const float a = 0.7f, h = 1.3f;
  maker.quad({-a, a, h}, {2 * a, 0, 0}, {0, -2 * a, 0}, maker.diffuse(Vec3f(0.5f)), Vec3f(5.0f));
  const double x = static_cast<double>(a / h), r = std::sqrt(1.0 + x * x);
  const double factor = 4.0 / (2.0 * 3.14159265358979) * (2.0 * x / r * std::atan(x / r));
  expect_irradiance(irradiance(maker.scene, {0, 0, 0}, {0, 0, 1}, 20000), 3.14159265 * 5.0 * factor);
  EXPECT_EQ(irradiance(maker.scene, {0, 0, 3}, {0, 0, -1}, 100).mean, 0.0) << "light leaves one side only";
}

// A picture on a parallelogram is drawn by its brightness: as much light as by area, with far less noise where little
// of it is bright; hits have the density of samples.
TEST(Lights, PicturesAreSampledByTheirBrightness) {
  SceneMaker maker;
  Texture t;
  t.kind = Texture::Kind::bitmap;
  t.width = 20;
  t.height = 10;
  t.pixels.assign(200, Vec3f(0.0f));
  t.pixels[20 * 3 + 4] = Vec3f(9.0f, 30.0f, 1.0f);
  t.pixels[20 * 7 + 15] = Vec3f(1.0f, 2.0f, 0.0f);
  const float turned[6] = {0.9f, 0.2f, 0.1f, -0.3f, 1.1f, 0.05f};
  std::copy(turned, turned + 6, t.to_uv);
  maker.quad({-1, 1.2f, 2}, {2, 0.3f, 0}, {0.2f, -2, 0.1f}, maker.diffuse(Vec3f(0.5f)), Vec3f(1.0f));
  maker.scene.area_lights[0].radiance = maker.texture(t);
  Scene bent = maker.scene;  // not a parallelogram: sampled by area
  bent.meshes[0].positions[2].z += 1e-3f;
  const Vec3f x{0.1f, -0.2f, 0.3f}, n{0, 0, 1};
  const Estimate by_picture = irradiance(maker.scene, x, n, 20000), by_area = irradiance(bent, x, n, 400000);
  EXPECT_LT(by_picture.error * std::sqrt(20000.0), 0.3 * by_area.error * std::sqrt(400000.0));
  EXPECT_NEAR(by_picture.mean, by_area.mean, 4.0 * (by_picture.error + by_area.error) + 2e-3 * by_area.mean);
  const auto tracer = make_embree_tracer(maker.scene);
  const Lights lights(maker.scene);
  Rng rng(4, RngPurpose::test, 6);
  int hits = 0, wrong = 0;
  double sum = 0.0;
  for (int i = 0; i < 20000; ++i) {
    const float pick = rng.uniform();
    const LightSample s = lights.sample(x, pick, rng.uniform2());
    if (!s.valid) continue;
    const Hit hit = tracer->intersect(x, s.direction, 0.0f, 1e30f);
    if (!hit.valid()) continue;
    ++hits;
    const SurfaceInteraction surface = interact(maker.scene, hit, x, s.direction);
    wrong += std::fabs(lights.pdf(x, surface) - s.pdf) > 1e-2f * s.pdf;  // at the edge of a cell
    EXPECT_NEAR(lights.emitted(surface, -s.direction).x, s.radiance.x, 1e-2f);
    sum += 1.0 / static_cast<double>(s.pdf);
  }
  EXPECT_GT(hits, 19900);
  EXPECT_LT(wrong, 20);
  // The density integrates to 1 over the solid angle of the light, which the mean of 1 / density is.
  Rng directions(4, RngPurpose::test, 7);
  double angle = 0.0;
  constexpr int kDirections = 200000;
  for (int i = 0; i < kDirections; ++i) {
    const float z = 1.0f - 2.0f * directions.uniform(), phi = 2.0f * kPi * directions.uniform();
    const float r = std::sqrt(std::fmax(0.0f, 1.0f - z * z));
    if (tracer->occluded(x, {r * std::cos(phi), r * std::sin(phi), z}, 0.0f, 1e30f))
      angle += 4.0 * 3.14159265 / kDirections;
  }
  EXPECT_NEAR(sum / 20000.0, angle, 0.15 * angle);
}

// A square, a sphere, a lamp without extent and a sky.
SceneMaker four_emitters() {
  SceneMaker maker;
  const int grey = maker.diffuse(Vec3f(0.5f));
  maker.quad({-1, 1, 2}, {2, 0, 0}, {0, -2, 0}, grey, Vec3f(1.0f, 2.0f, 3.0f));
  maker.sphere({2.0f, 0.0f, 1.0f}, 0.5f, grey, Vec3f(4.0f));
  DeltaLight point;
  point.position = {0, 2, 2};
  maker.scene.delta_lights.push_back(point);
  maker.scene.environments.push_back(speckled_environment(16, 9));
  return maker;
}

// Each is picked as often as its weight says, its densities hold that probability, and one of weight 0 never comes.
TEST(Lights, WeightsArePickProbabilities) {
  const SceneMaker maker = four_emitters();
  Lights lights(maker.scene);
  for (int i = 0; i < 4; ++i) EXPECT_FLOAT_EQ(light_pick(lights.view(), i), 0.25f);
  const float weights[] = {3.0f, 0.0f, 1.0f, 4.0f}, picks[] = {0.375f, 0.0f, 0.125f, 0.5f};
  const Vec3f x{0.1f, -0.2f, 0.3f};
  const Vec2f u{0.3f, 0.6f};
  float uniform[4];
  for (int i = 0; i < 4; ++i) uniform[i] = lights.sample(x, 0.25f * static_cast<float>(i), u).pdf;
  lights.set_weights(weights);
  int counts[4] = {};
  constexpr int kCount = 8000;
  for (int n = 0; n < kCount; ++n) {
    const float pick = (static_cast<float>(n) + 0.5f) / kCount;
    const int i = pick_light(lights.view(), pick);
    ++counts[i];
    EXPECT_EQ(lights.pick(pick), light_pick(lights.view(), i));
    EXPECT_FLOAT_EQ(lights.sample(x, pick, u).pdf, uniform[i] * 4.0f * picks[i]);
  }
  for (int i = 0; i < 4; ++i) {
    EXPECT_FLOAT_EQ(light_pick(lights.view(), i), picks[i]);
    EXPECT_NEAR(counts[i], kCount * picks[i], 1.0f);
  }
  EXPECT_EQ(pick_light(lights.view(), 0x1.fffffep-1f), 3);
}

// The scene file's own, 1 where it has some and not this one.
TEST(Lights, WeightsOfTheFile) {
  SceneMaker maker = four_emitters();
  EXPECT_TRUE(maker.scene.sampling_weights().empty());
  maker.scene.delta_lights[0].sampling_weight = 2.0f;
  maker.scene.environments[0].sampling_weight = 0.0f;
  EXPECT_EQ(maker.scene.sampling_weights(), (std::vector<float>{1.0f, 1.0f, 2.0f, 0.0f}));
  const Lights lights(maker.scene);
  EXPECT_FLOAT_EQ(light_pick(lights.view(), 2), 0.5f);
  EXPECT_EQ(lights.environment_pdf(Vec3f(0.0f), {0, 0, 1}), 0.0f);
  EXPECT_GT(max_component(lights.environment({0, 0, 1})), 0.0f) << "BSDF rays find it";
}

// Draws in steps, of which the first is for `begin`, are those in one from `x`.
void expect_steps_are_samples(const Lights& lights, Vec3f begin, Vec3f x) {
  Rng rng(5, RngPurpose::test, 6);
  int in_map = 0;
  for (int i = 0; i < 500; ++i) {
    const float pick = rng.uniform();
    const Vec2f u = rng.uniform2();
    Lights::Draw draw = lights.begin(begin, pick, u);
    lights.go_on(draw);
    in_map += draw.in_map ? 1 : 0;
    const LightSample s = lights.finish(draw, x), expected = lights.sample(x, pick, u);
    EXPECT_EQ(s.valid, expected.valid);
    EXPECT_EQ(s.direction, expected.direction);
    EXPECT_EQ(s.distance, expected.distance);
    EXPECT_EQ(s.radiance, expected.radiance);
    EXPECT_EQ(s.pdf, expected.pdf);
  }
  EXPECT_GT(in_map, 50);
}

TEST(Lights, DrawsInStepsAreSamples) {
  SceneMaker maker = four_emitters();
  const Vec3f x{0.1f, -0.2f, 0.3f};
  expect_steps_are_samples(Lights(maker.scene), x, x);
}

// Where the first step's place is beside that of the last one, the density is still that of the last one's.
TEST(Lights, DrawsInStepsNextToABorderOfPlaces) {
  SceneMaker maker = four_emitters();
  Lights lights(maker.scene);
  lights.set_environment_places(speckled_places());
  const Vec3f x{0.500001f, 0.2f, 0.3f}, beside{0.499999f, 0.2f, 0.3f};
  ASSERT_NE(lights.view().environment.places.place(x), lights.view().environment.places.place(beside));
  expect_steps_are_samples(lights, beside, x);
}

TEST(Lights, DensityOfHitAgreesWithSampling) {
  SceneMaker maker = four_emitters();
  maker.scene.delta_lights.clear();
  const auto tracer = make_embree_tracer(maker.scene);
  Lights lights(maker.scene);
  lights.set_weights(std::vector<float>{2.0f, 1.0f, 1.5f});
  EXPECT_FALSE(lights.empty());
  const Vec3f x{0.1f, -0.2f, 0.3f};
  Rng rng(4, RngPurpose::test, 5);
  int hits = 0, misses = 0;
  for (int i = 0; i < 3000; ++i) {
    const float pick = rng.uniform();
    const LightSample s = lights.sample(x, pick, rng.uniform2());
    if (!s.valid) continue;
    const Hit hit = tracer->intersect(x, s.direction, 0.0f, 1e30f);
    if (s.distance >= kEnvironmentDistance) {
      if (hit.valid()) continue;
      ++misses;
      EXPECT_NEAR(lights.environment_pdf(x, s.direction), s.pdf, 5e-3f * s.pdf + 1e-5f);
      EXPECT_NEAR(lights.environment(s.direction).x, s.radiance.x, 1e-2f);
      continue;
    }
    if (!hit.valid()) continue;  // the rim of a shape, missed by a rounding error
    ++hits;
    EXPECT_NEAR(hit.t, s.distance, 2e-3f * s.distance);
    const SurfaceInteraction surface = interact(maker.scene, hit, x, s.direction);
    EXPECT_NEAR(lights.pdf(x, surface), s.pdf, 1e-2f * s.pdf);
    EXPECT_EQ(lights.emitted(surface, -s.direction), s.radiance);
    EXPECT_EQ(lights.emitted(surface, s.direction), Vec3f(0.0f));
  }
  EXPECT_GT(hits, 1500);
  EXPECT_GT(misses, 500);
}

// The side that emits is that of the interpolated normals where a mesh has any (here they contradict the facets and
// lean), and that of the facets otherwise; sampling and hits agree on it, on the radiance and on the density.
TEST(Lights, VertexNormalsDecideWhichSideEmits) {
  for (const bool vertex_normals : {false, true}) {
    SCOPED_TRACE(vertex_normals);
    SceneMaker maker;
    TriangleMesh m;
    m.positions = {{-1, -1, 1}, {1, -1, 1}, {1, 1, 1}, {-1, 1, 1}};
    m.triangles = {{0, 1, 2}, {0, 2, 3}};  // facets look along +z
    if (vertex_normals)
      m.normals = {normalize(Vec3f(-0.5f, 0, -1)), normalize(Vec3f(0.5f, 0, -1)), normalize(Vec3f(0.5f, 0.2f, -1)),
                   normalize(Vec3f(0, 0, -1))};
    maker.scene.meshes.push_back(m);
    maker.shape(Shape::Kind::mesh, 0, maker.diffuse(Vec3f(0.5f)), Vec3f(2.0f));
    const auto tracer = make_embree_tracer(maker.scene);
    const Lights lights(maker.scene);
    for (const bool above : {false, true}) {
      SCOPED_TRACE(above);
      const Vec3f x{0.1f, -0.2f, above ? 2.5f : -0.5f};
      const bool lit = above != vertex_normals;
      Rng rng(9, RngPurpose::test, 1);
      int agreed = 0;
      for (int i = 0; i < 200; ++i) {
        const float pick = rng.uniform();
        const LightSample s = lights.sample(x, pick, rng.uniform2());
        EXPECT_EQ(s.valid, lit);
        const Vec3f target{2.0f * rng.uniform() - 1.0f, 2.0f * rng.uniform() - 1.0f, 1.0f};
        const Vec3f direction = s.valid ? s.direction : normalize(target - x);
        const Hit hit = tracer->intersect(x, direction, 0.0f, 1e30f);
        if (!hit.valid()) continue;
        const SurfaceInteraction surface = interact(maker.scene, hit, x, direction);
        EXPECT_EQ(lights.emitted(surface, -direction), Vec3f(lit ? 2.0f : 0.0f));
        EXPECT_EQ(lights.emitted(surface, -direction), s.valid ? s.radiance : Vec3f(0.0f));
        EXPECT_NEAR(lights.pdf(x, surface), s.valid ? s.pdf : 0.0f, 1e-3f * s.pdf);
        ++agreed;
      }
      EXPECT_GT(agreed, 190);
    }
  }
}

// Directions drawn on a mesh that emits follow the density that a ray finds there.
void expect_samples_by_density(const TriangleMesh& mesh, bool parallelogram, const Texture* texture = nullptr) {
  SceneMaker maker;
  maker.scene.meshes.push_back(mesh);
  maker.shape(Shape::Kind::mesh, 0, maker.diffuse(Vec3f(0.5f)), Vec3f(1.0f));
  if (texture != nullptr) maker.scene.area_lights.back().radiance = maker.texture(*texture);
  const auto tracer = make_embree_tracer(maker.scene);
  const Lights lights(maker.scene);
  EXPECT_EQ(lights.view().area[0].parallelogram, parallelogram);
  const Vec3f x{0.1f, 0.2f, 0.0f};
  const auto result = testing::chi_square(
      [&](Rng& rng, Vec3f& w) {
        const LightSample s = lights.sample(x, rng.uniform(), rng.uniform2());
        w = s.direction;
        return s.valid;
      },
      [&](Vec3f w) {
        const Hit hit = tracer->intersect(x, w, 0.0f, 1e30f);
        return hit.valid() ? static_cast<double>(lights.pdf(x, interact(maker.scene, hit, x, w))) : 0.0;
      },
      100000, 11, 24, 36, 16);
  EXPECT_GT(result.p_value, 0.001) << result.text;
  EXPECT_NEAR(result.integral, 1.0, 0.01);
}

TEST(Lights, MeshSamplesFollowTheirDensity) {
  if (testing::sanitized()) GTEST_SKIP() << "statistics of many samples; others draw some under the sanitizers";
  TriangleMesh m;
  m.positions = {{-1, -1, 1}, {1, -1, 1.2f}, {-1, 1, 1.4f}, {1.5f, 1.5f, 0.6f}, {-0.5f, 2.5f, 0.8f}};
  m.triangles = {{0, 2, 1}, {1, 2, 3}, {3, 2, 4}};
  expect_samples_by_density(m, false);
  m.triangles.pop_back();
  SCOPED_TRACE("two triangles, no parallelogram");
  expect_samples_by_density(m, false);
}

// With a texture the cosine is that of the face: densities add up to 1, whatever the vertex normals.
TEST(Lights, TexturedLampsWithVertexNormals) {
  if (testing::sanitized()) GTEST_SKIP() << "statistics of many samples; others draw some under the sanitizers";
  TriangleMesh m;
  m.positions = {{-1, -1, 1}, {1, -1, 1.2f}, {-1, 1, 1.4f}, {1.5f, 1.5f, 0.6f}};
  m.triangles = {{0, 2, 1}, {1, 2, 3}};
  for (const Vec3f lean : {Vec3f(0.5f, 0.1f, -1), Vec3f(-0.4f, 0, -1), Vec3f(0, 0.6f, -1), Vec3f(0.3f, 0.3f, -1)})
    m.normals.push_back(normalize(lean));
  m.uvs = {{0, 0}, {1, 0}, {0, 1}, {1, 1}};
  Texture t;
  t.kind = Texture::Kind::bitmap;
  t.width = t.height = 2;
  t.pixels = {Vec3f(1.0f), Vec3f(5.0f), Vec3f(2.0f), Vec3f(0.5f)};
  expect_samples_by_density(m, false, &t);
}

// Whichever corners the two triangles begin with, and whether they share vertices.
TEST(Lights, ParallelogramsAreDrawnAsOne) {
  if (testing::sanitized()) GTEST_SKIP() << "statistics of many samples; others draw some under the sanitizers";
  TriangleMesh m;
  m.positions = {{-1, -1, 1}, {1, -1, 1.2f}, {-0.5f, 1, 1.4f}, {1.5f, 1, 1.6f}};
  const auto turned = [](Vec3i t, int by) { return Vec3i{t[by % 3], t[(by + 1) % 3], t[(by + 2) % 3]}; };
  for (int i = 0; i < 9; ++i) {
    SCOPED_TRACE(i);
    m.triangles = {turned({0, 2, 1}, i / 3), turned({1, 2, 3}, i % 3)};
    expect_samples_by_density(m, true);
  }
  TriangleMesh apart = m;
  apart.positions.insert(apart.positions.end(), m.positions.begin(), m.positions.end());
  apart.triangles[1] = {1 + 4, 2 + 4, 3 + 4};
  expect_samples_by_density(apart, true);
}

}  // namespace
}  // namespace octrad
