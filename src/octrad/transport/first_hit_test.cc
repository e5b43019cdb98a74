#include "octrad/transport/first_hit_math.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "octrad/base/circle_math.h"
#include "octrad/scene/sample_scenes.h"
#include "octrad/shading/fresnel.h"
#include "octrad/transport/prepared_scene.h"
#include "octrad/transport/rhs_estimator.h"

namespace octrad {
namespace {

using Bounce = FirstHitOptions::Bounce;
using Next = FirstHitQuery::Next;

struct Found {
  FirstHitQuery query;
  RayEnd end;
  FirstHit first;
};

Found look_along(const PreparedScene& scene, Vec3f direction, const FirstHitOptions& options = {}) {
  CameraSample sample{{{0, 0, 0}, direction, 1e30f}, Rng(1, RngPurpose::test, 0), {}};
  Found found;
  found.query = trace_first_hit(scene.context(), options, sample, found.end, found.first);
  return found;
}

void add_even_sky(testing::SceneMaker& maker, float radiance) {
  Environment sky;
  sky.width = 2;
  sky.height = 2;
  sky.pixels.assign(4, Vec3f(radiance));
  maker.scene.environments.push_back(sky);
}

// Before the camera: to -z a lamp of radiance 3, to +z a mirror that shows it, to +x a rough metal wall, to -x nothing
// but the sky of radiance .25.
PreparedScene scene_around() {
  testing::SceneMaker maker;
  const int grey = maker.diffuse(Vec3f(0.5f), true);
  maker.quad({-1, -1, -2}, {2, 0, 0}, {0, 2, 0}, grey, Vec3f(3.0f));
  Material mirror, metal;
  mirror.type = BsdfType::conductor;
  mirror.two_sided = true;
  metal.type = BsdfType::roughconductor;
  metal.two_sided = true;
  metal.alpha_u = metal.alpha_v = maker.texture(0.2f);
  maker.quad({-1, -1, 2}, {2, 0, 0}, {0, 2, 0}, maker.material(mirror));
  maker.quad({2, -1, -1}, {0, 0, 2}, {0, 2, 0}, maker.material(metal));
  add_even_sky(maker, 0.25f);
  return PreparedScene(maker.scene);
}

TEST(FirstHit, EmissionIsKnownUnlessTheResponseHoldsIt) {
  const PreparedScene scene = scene_around();
  FirstHitOptions options;
  const Found outside = look_along(scene, {0, 0, -1}, options);
  EXPECT_EQ(outside.query.next, Next::query);
  EXPECT_FLOAT_EQ(outside.query.known.x, 3.0f);
  options.emission_inside = true;
  EXPECT_FLOAT_EQ(look_along(scene, {0, 0, -1}, options).query.known.x, 0.0f);
  // A bounce estimates scattered light alone: the lamp's own emission is known again.
  options.bounce = Bounce::all;
  const Found bounced = look_along(scene, {0, 0, -1}, options);
  EXPECT_EQ(bounced.query.next, Next::bounce);
  EXPECT_FLOAT_EQ(bounced.query.known.x, 3.0f);
}

TEST(FirstHit, TheSkyIsKnownAndLeavesNothingToAsk) {
  const PreparedScene scene = scene_around();
  for (const bool inside : {false, true}) {
    FirstHitOptions options;
    options.emission_inside = inside;
    options.bounce = Bounce::all;
    const Found found = look_along(scene, {-1, 0, 0}, options);
    EXPECT_EQ(found.query.next, Next::nothing);
    EXPECT_FLOAT_EQ(found.query.known.x, 0.25f);
    EXPECT_FALSE(found.first.valid);
  }
}

TEST(FirstHit, DeltaChainsAreFollowedAndKeepTheirFirstSurface) {
  const PreparedScene scene = scene_around();
  FirstHitOptions options;
  const Found cached = look_along(scene, {0, 0, 1}, options);
  EXPECT_EQ(cached.query.next, Next::query);
  EXPECT_FLOAT_EQ(cached.end.point.surface.position.z, 2.0f);
  options.follow_below = kFollowDelta;
  const Found traced = look_along(scene, {0, 0, 1}, options);
  EXPECT_FLOAT_EQ(traced.end.point.surface.position.z, -2.0f);
  EXPECT_FLOAT_EQ(traced.query.known.x, 3.0f * traced.end.throughput.x);
  EXPECT_EQ(traced.end.rays, 2);
  EXPECT_FLOAT_EQ(traced.first.depth, 2.0f);
  EXPECT_EQ(traced.first.roughness, 0.0f);
  // What the chain met before its end is not what the response holds.
  options.emission_inside = true;
  EXPECT_FLOAT_EQ(look_along(scene, {0, 0, 1}, options).query.known.x, 0.0f);
  options.max_chain = 0;
  EXPECT_EQ(look_along(scene, {0, 0, 1}, options).query.next, Next::nothing);
}

// Two lamps one behind the other before a wall, a mirror that shows them, a curtain before the sky.
TEST(FirstHit, HiddenEmittersLetTheCameraSeeWhatIsBehindThem) {
  testing::SceneMaker maker;
  const int grey = maker.diffuse(Vec3f(0.5f), true);
  maker.quad({-1, -1, -1}, {2, 0, 0}, {0, 2, 0}, grey, Vec3f(3.0f));
  maker.sphere({0, 0, -2}, 0.5f, grey, Vec3f(2.0f));
  maker.quad({-1, -1, -4}, {2, 0, 0}, {0, 2, 0}, grey);
  Material mirror, curtain;
  mirror.type = BsdfType::conductor;
  mirror.two_sided = true;
  curtain.reflectance = maker.texture(0.3f);
  curtain.opacity = maker.texture(0.5f);
  curtain.two_sided = true;
  maker.quad({-1, -1, 2}, {2, 0, 0}, {0, 2, 0}, maker.material(mirror));
  maker.quad({-2, -1, -1}, {0, 0, 2}, {0, 2, 0}, maker.material(curtain));
  Environment sky;
  sky.width = sky.height = 2;
  sky.pixels.assign(4, Vec3f(0.25f));
  maker.scene.environments.push_back(sky);
  maker.scene.hide_emitters = true;
  const PreparedScene scene(maker.scene);
  FirstHitOptions options;
  options.follow_below = kFollowDelta;

  const Found wall = look_along(scene, {0, 0, -1}, options);
  EXPECT_EQ(wall.query.next, Next::query);
  EXPECT_EQ(wall.query.known, Vec3f(0.0f));
  EXPECT_FLOAT_EQ(wall.end.point.surface.position.z, -4.0f);
  EXPECT_NEAR(wall.first.depth, 4.0f, 1e-5f);
  EXPECT_EQ(wall.end.rays, 4);  // two lamps, the first and the far side of the ball

  const Found in_mirror = look_along(scene, {0, 0, 1}, options);
  EXPECT_FLOAT_EQ(in_mirror.end.point.surface.position.z, -1.0f);
  EXPECT_FLOAT_EQ(in_mirror.query.known.x, 3.0f * in_mirror.end.throughput.x);

  const Found nothing = look_along(scene, {0, 1, 0}, options);
  EXPECT_EQ(nothing.query.next, Next::nothing);
  EXPECT_EQ(nothing.query.known, Vec3f(0.0f));
  EXPECT_FALSE(nothing.first.valid);

  int through = 0;
  for (unsigned long long i = 0; i < 100; ++i) {
    CameraSample sample{{{0, 0, 0}, {-1, 0, 0}, 1e30f}, Rng(1, RngPurpose::test, i), {}};
    RayEnd end;
    FirstHit first;
    const FirstHitQuery query = trace_first_hit(scene.context(), options, sample, end, first);
    EXPECT_EQ(query.known, Vec3f(0.0f));
    EXPECT_EQ(query.next, first.valid ? Next::query : Next::nothing);
    through += !first.valid;
  }
  EXPECT_NEAR(through, 50, 20);
}

// A lamp that a far clipping plane cuts off is not there, and what lies beyond it neither.
TEST(FirstHit, HiddenEmittersDoNotMoveTheFarPlane) {
  testing::SceneMaker maker;
  const int grey = maker.diffuse(Vec3f(0.5f), true);
  maker.quad({-1, -1, -1}, {2, 0, 0}, {0, 2, 0}, grey, Vec3f(3.0f));
  maker.quad({-1, -1, -4}, {2, 0, 0}, {0, 2, 0}, grey);
  maker.scene.hide_emitters = true;
  const PreparedScene scene(maker.scene);
  for (const float far : {3.9f, 4.1f}) {
    int rays = 0;
    const Hit hit = camera_hit(scene.context(), Ray{{0, 0, 0}, {0, 0, -1}, far}, rays);
    EXPECT_EQ(hit.valid(), far > 4.0f);
    EXPECT_EQ(rays, 2);
  }
}

// Passed surfaces are lit by both ways of sampling, whose weights add up to one.
TEST(FirstHit, NearMirrorsAreFollowedAndShowLampsAndSky) {
  const PreparedScene scene = scene_around();
  const auto light_over_the_metal = [&](float follow_below) {
    FirstHitOptions options;
    options.follow_below = follow_below;
    options.max_chain = 1;
    Vec3f sum(0.0f);
    constexpr int kSamples = 1 << 15;
    for (unsigned long long i = 0; i < kSamples; ++i) {
      CameraSample sample{{{0, 0, 0}, normalize(Vec3f(1.0f, 0, -0.3f)), 1e30f}, Rng(1, RngPurpose::test, i), {}};
      RayEnd end;
      FirstHit first;
      sum += trace_first_hit(scene.context(), options, sample, end, first).known;
      EXPECT_FLOAT_EQ(first.roughness, 0.2f);
    }
    return sum / static_cast<float>(kSamples);
  };
  EXPECT_EQ(light_over_the_metal(0.2f), Vec3f(0.0f));  // below is exclusive
  const Found metal = look_along(scene, normalize(Vec3f(1.0f, 0, -0.3f)));
  RhsOptions direct;
  direct.directions = 1 << 14;
  direct.max_chain = 0;
  Vec3f expected;
  estimate_rhs_serial(scene.context(), {&metal.end.point, 1}, direct, nullptr, {&expected, 1});
  const Vec3f found = light_over_the_metal(0.21f);
  EXPECT_GT(expected.x, 0.1f);
  for (int c = 0; c < 3; ++c) EXPECT_NEAR(found[c], expected[c], 0.01f * expected[c]);
}

TEST(FirstHit, GlossySurfacesBounceBelowTheThreshold) {
  const PreparedScene scene = scene_around();
  FirstHitOptions options;
  options.bounce = Bounce::glossy;
  options.rough_threshold = 0.3f;
  const Found glossy = look_along(scene, {1, 0, 0}, options);
  EXPECT_EQ(glossy.query.next, Next::bounce);
  EXPECT_NE(glossy.query.key, look_along(scene, {0, 0, 1}, options).query.key + 1);
  options.rough_threshold = 0.2f;  // below is exclusive
  EXPECT_EQ(look_along(scene, {1, 0, 0}, options).query.next, Next::query);
}

TEST(FirstHit, MirrorsBounceOnlyWhereTheyAreAskedTo) {
  const PreparedScene scene = scene_around();
  FirstHitOptions options;
  options.bounce = Bounce::glossy;
  options.rough_threshold = 0.3f;
  EXPECT_EQ(look_along(scene, {0, 0, 1}, options).query.next, Next::bounce);
  options.bounce_delta = false;
  EXPECT_EQ(look_along(scene, {0, 0, 1}, options).query.next, Next::query);
  EXPECT_EQ(look_along(scene, {1, 0, 0}, options).query.next, Next::bounce);  // glossy
}

// Rough glass is two points: its reflection, looked up like a mirror, and what comes through it, looked up where that
// comes from (method section 1).
TEST(FirstHit, RoughGlassIsAskedForWhatIsBehindIt) {
  testing::SceneMaker maker;
  Material glass;
  glass.type = BsdfType::roughdielectric;
  glass.alpha_u = glass.alpha_v = maker.texture(0.2f);
  glass.int_ior = 1.5f;
  glass.ext_ior = 1.0f;
  maker.quad({2, -5, -5}, {0, 0, 10}, {0, 10, 0}, maker.material(glass));  // faces -x
  const PreparedScene scene(maker.scene);
  FirstHitOptions options;
  options.split_coats = true;
  Found found = look_along(scene, normalize(Vec3f(1.0f, 0.0f, 0.5f)), options);
  ASSERT_EQ(found.query.next, Next::query);
  std::vector<SurfacePoint> points;
  for_each_asked_lobe(options, found.end.point, [&] { points.push_back(surface_point(found.end.point)); });
  ASSERT_EQ(points.size(), 2u);
  const float sine = 0.5f / std::sqrt(1.25f);
  const LookupRule rule;
  for (const SurfacePoint& p : points) EXPECT_LT(length(p.n - Vec3f(-1, 0, 0)), 1e-5f);
  const Vec3f reflected = lookup_direction(rule, points[0]), refracted = lookup_direction(rule, points[1]);
  EXPECT_LT(reflected.x, 0.0f);
  EXPECT_NEAR(reflected.z, sine, 1e-5f);
  EXPECT_GT(refracted.x, 0.0f);
  EXPECT_NEAR(refracted.z, sine / 1.5f, 1e-5f);  // Snell
  EXPECT_NEAR(length(points[1].wo), 1.0f, 1e-5f);
  EXPECT_NEAR(points[0].albedo.x + points[1].albedo.x * 2.25f, 1.0f, 1e-5f);  // light is stronger by eta^2 inside
  options.split_coats = false;
  found = look_along(scene, {1, 0, 0}, options);
  EXPECT_GT(lookup_direction(rule, surface_point(found.end.point)).x, 0.99f);
}

// What a model, or the coat of a coated one, reflects of even light: values over the hemisphere, or, where it is
// smooth, Fresnel's reflectance.
double reflected(Bsdf bsdf, Vec3f wo) {
  if (bsdf.type == BsdfType::plastic) return static_cast<double>(fresnel_dielectric(wo.z, bsdf.eta).reflectance);
  if (is_coated(bsdf)) bsdf.lobe = Lobe::coat;
  constexpr int kHeights = 400, kTurns = 400;
  double sum = 0.0;
  for (int i = 0; i < kHeights * kTurns; ++i) {
    const float z = (static_cast<float>(i / kTurns) + 0.5f) / kHeights;
    const Vec2f around = circle_point((static_cast<float>(i % kTurns) + 0.5f) / kTurns) * std::sqrt(1.0f - z * z);
    sum += static_cast<double>(evaluate_bsdf(bsdf, wo, {around.x, around.y, z}).value.x);
  }
  return sum * 2.0 * 3.14159265358979 / (kHeights * kTurns);
}

// A coated wall before an even sky, which its coat reflects: the light that is known is the coat's share of it.
TEST(FirstHit, CoatsAreFollowedAfterSomeSamples) {
  for (const float alpha : {0.0f, 0.2f}) {
    testing::SceneMaker maker;
    Material plastic;
    plastic.type = alpha > 0.0f ? BsdfType::roughplastic : BsdfType::plastic;
    plastic.alpha_u = plastic.alpha_v = maker.texture(alpha);
    plastic.reflectance = maker.texture(Vec3f(0.6f));
    plastic.int_ior = 1.5f;
    plastic.ext_ior = 1.0f;
    maker.quad({2, -5, -5}, {0, 0, 10}, {0, 10, 0}, maker.material(plastic));  // faces -x
    add_even_sky(maker, 3.0f);
    const PreparedScene scene(maker.scene);
    FirstHitOptions options;
    options.split_coats = true;
    options.follow_below = kFollowDelta;
    options.coat_samples = 100.0f;
    double known = 0.0, expected = 0.0;
    constexpr int kSamples = 4000;
    for (int i = 0; i < kSamples; ++i) {
      const int number = i < 10 ? i : 1000;
      CameraSample sample{{{0, 0, 0}, normalize(Vec3f(1.0f, 0.0f, 1.5f)), 1e30f},
                          Rng::of_sample(1, RngPurpose::test, 0, static_cast<std::uint32_t>(i)),
                          {},
                          number};
      RayEnd end;
      FirstHit first;
      ASSERT_EQ(trace_first_hit(scene.context(), options, sample, end, first).next, Next::query);
      const bool follows = static_cast<float>(number) >= 100.0f * alpha * alpha;
      EXPECT_EQ(follows_lobe(options, end.point.bsdf, number), follows);
      if (i == 0) expected = 3.0 * reflected(end.point.bsdf, end.point.to_local(end.point.wo));
      Vec3f found(0.0f);
      std::vector<Lobe> asked;
      int counted = 0;
      for_each_asked_point(
          scene.context(), options, number, end, {}, {}, sample.rng, found, [&](int n) { counted = n; },
          [&](const ShadingPoint& point, Vec3f weight, const Segment&, const Hit&) {
            asked.push_back(point.bsdf.lobe);
            EXPECT_EQ(weight, Vec3f(1.0f));
          });
      EXPECT_EQ(asked, follows ? std::vector<Lobe>{Lobe::base} : (std::vector<Lobe>{Lobe::coat, Lobe::base}));
      EXPECT_EQ(counted, static_cast<int>(asked.size()));
      if (number == 1000) known += static_cast<double>(found.x) / (kSamples - 10);
      EXPECT_TRUE(follows || found == Vec3f(0.0f));
    }
    EXPECT_NEAR(known, expected, (alpha > 0.0f ? 0.01 : 1e-4) * expected) << alpha;
  }
}

// What the coat shows is asked for where its ray ends, once, with one lobe of a surface that has two.
TEST(FirstHit, FollowedCoatsAskWhereTheirRayEnds) {
  testing::SceneMaker maker;
  Material plastic;
  plastic.type = BsdfType::plastic;
  plastic.reflectance = maker.texture(Vec3f(0.6f));
  maker.quad({2, -5, -5}, {0, 0, 10}, {0, 10, 0}, maker.material(plastic));       // faces -x
  maker.quad({-3, -50, -50}, {0, 100, 0}, {0, 0, 100}, maker.material(plastic));  // faces +x
  const PreparedScene scene(maker.scene);
  FirstHitOptions options;
  options.split_coats = true;
  options.follow_below = kFollowDelta;
  options.coat_samples = 1.0f;
  int lobes[2] = {0, 0};
  double weight_of_far = 0.0;
  constexpr int kSamples = 2000;
  for (int i = 0; i < kSamples; ++i) {
    CameraSample sample{{{0, 0, 0}, {1, 0, 0}, 1e30f}, Rng(1, RngPurpose::test, static_cast<std::uint64_t>(i)), {}, 0};
    RayEnd end;
    FirstHit first;
    trace_first_hit(scene.context(), options, sample, end, first);
    Vec3f known(0.0f);
    std::vector<float> places;
    for_each_asked_point(
        scene.context(), options, 0, end, {}, {}, sample.rng, known, [](int n) { EXPECT_EQ(n, 2); },
        [&](const ShadingPoint& point, Vec3f weight, const Segment& segment, const Hit& hit) {
          places.push_back(point.surface.position.x);
          if (places.size() > 1) return;
          ++lobes[point.bsdf.lobe == Lobe::coat];
          weight_of_far += static_cast<double>(weight.x) / kSamples;
          EXPECT_TRUE(hit.valid());
          EXPECT_NEAR(segment.direction.x, -1.0f, 1e-5f);
        });
    ASSERT_EQ(places.size(), 2u);
    EXPECT_NEAR(places[0], -3.0f, 1e-4f);
    EXPECT_NEAR(places[1], 2.0f, 1e-4f);
  }
  EXPECT_GT(lobes[0], kSamples / 10);
  EXPECT_GT(lobes[1], kSamples / 10);
  const float half = (1.49f - 1.000277f) / (1.49f + 1.000277f);  // Fresnel at normal incidence; two lobes are asked for
  EXPECT_NEAR(weight_of_far, 2.0 * static_cast<double>(half * half), 0.01);
}

// A wall of metal before an even sky: once it is followed, all that it reflects is known, and nothing is asked.
TEST(FirstHit, MetalsAreFollowedAfterSomeSamples) {
  testing::SceneMaker maker;
  Material metal;
  metal.type = BsdfType::roughconductor;
  metal.alpha_u = metal.alpha_v = maker.texture(0.2f);
  maker.quad({2, -5, -5}, {0, 0, 10}, {0, 10, 0}, maker.material(metal));  // faces -x
  add_even_sky(maker, 3.0f);
  const PreparedScene scene(maker.scene);
  FirstHitOptions options;
  options.split_coats = true;
  options.follow_below = kFollowDelta;
  options.metal_samples = 100.0f;  // from sample 4 on
  double known = 0.0, expected = 0.0;
  constexpr int kSamples = 4000;
  for (int i = 0; i < kSamples; ++i) {
    const int number = i < 4 ? i : 4;
    CameraSample sample{{{0, 0, 0}, normalize(Vec3f(1.0f, 0.0f, 1.5f)), 1e30f},
                        Rng(1, RngPurpose::test, static_cast<std::uint64_t>(i)),
                        {},
                        number};
    RayEnd end;
    FirstHit first;
    ASSERT_EQ(trace_first_hit(scene.context(), options, sample, end, first).next, Next::query);
    if (i == 0) expected = 3.0 * reflected(end.point.bsdf, end.point.to_local(end.point.wo));
    Vec3f found(0.0f);
    int counted = -1, asked = 0;
    for_each_asked_point(
        scene.context(), options, number, end, {}, {}, sample.rng, found, [&](int n) { counted = n; },
        [&](const ShadingPoint&, Vec3f, const Segment&, const Hit&) { ++asked; });
    EXPECT_EQ(asked, number < 4 ? 1 : 0);
    EXPECT_EQ(counted, asked);
    if (number < 4) EXPECT_EQ(found, Vec3f(0.0f));
    else known += static_cast<double>(found.x) / (kSamples - 4);
  }
  EXPECT_NEAR(known, expected, 0.01 * expected);
}

// Glass is passed: what lies behind it is asked for.
TEST(FirstHit, FollowedGlassAsksBehindIt) {
  testing::SceneMaker maker;
  Material glass;
  glass.type = BsdfType::roughdielectric;
  glass.alpha_u = glass.alpha_v = maker.texture(0.1f);
  maker.quad({-5, -5, 2}, {0, 10, 0}, {10, 0, 0}, maker.material(glass));                  // faces -z
  maker.quad({-50, -50, 3}, {100, 0, 0}, {0, 100, 0}, maker.diffuse(Vec3f(0.5f), true));   // behind it
  maker.quad({-50, -50, -1}, {100, 0, 0}, {0, 100, 0}, maker.diffuse(Vec3f(0.5f), true));  // before it
  const PreparedScene scene(maker.scene);
  FirstHitOptions options;
  options.split_coats = true;
  options.follow_below = kFollowDelta;
  options.metal_samples = 1.0f;
  int behind = 0, before = 0;
  double weight_behind = 0.0;
  constexpr int kSamples = 2000;
  for (int i = 0; i < kSamples; ++i) {
    CameraSample sample{{{0, 0, 0}, {0, 0, 1}, 1e30f}, Rng(1, RngPurpose::test, static_cast<std::uint64_t>(i)), {}, 1};
    RayEnd end;
    FirstHit first;
    trace_first_hit(scene.context(), options, sample, end, first);
    Vec3f known(0.0f);
    for_each_asked_point(
        scene.context(), options, 1, end, {}, {}, sample.rng, known, [](int n) { EXPECT_EQ(n, 1); },
        [&](const ShadingPoint& point, Vec3f weight, const Segment& segment, const Hit& hit) {
          EXPECT_TRUE(hit.valid());
          EXPECT_GT(segment.pdf, 0.0f);
          const bool passed = point.surface.position.z > 2.5f;
          ++(passed ? behind : before);
          if (passed) weight_behind += static_cast<double>(weight.x) / kSamples;
        });
  }
  EXPECT_GT(before, 0);
  EXPECT_EQ(before + behind, kSamples);
  const double eta = 1.5046 / 1.000277, half = (eta - 1.0) / (eta + 1.0);  // Fresnel at normal incidence
  EXPECT_NEAR(weight_behind, (1.0 - half * half) / (eta * eta), 0.02);
}

TEST(FirstHit, WhichLobesAreFollowed) {
  FirstHitOptions options;
  options.split_coats = true;
  options.follow_below = kFollowDelta;
  options.coat_samples = options.metal_samples = 10.0f;
  const auto follows = [&](BsdfType type, float alpha, int number) {
    Bsdf bsdf{};
    bsdf.type = type;
    bsdf.alpha_u = bsdf.alpha_v = alpha;
    return follows_lobe(options, bsdf, number);
  };
  for (const BsdfType type : {BsdfType::roughconductor, BsdfType::roughdielectric, BsdfType::roughplastic}) {
    EXPECT_FALSE(follows(type, 0.5f, 2));
    EXPECT_TRUE(follows(type, 0.5f, 3));  // 10 x .25 samples have asked
  }
  for (const BsdfType type : {BsdfType::diffuse, BsdfType::roughdiffuse, BsdfType::hair, BsdfType::blendbsdf})
    EXPECT_FALSE(follows(type, 0.1f, 1 << 20)) << static_cast<int>(type);
  options.metal_samples = 0.0f;
  EXPECT_FALSE(follows(BsdfType::roughconductor, 0.1f, 1 << 20));
  EXPECT_TRUE(follows(BsdfType::roughplastic, 0.1f, 1 << 20));
  options.metal_samples = 10.0f;
  options.coat_samples = 0.0f;
  EXPECT_TRUE(follows(BsdfType::roughconductor, 0.1f, 1 << 20));
  EXPECT_FALSE(follows(BsdfType::roughplastic, 0.1f, 1 << 20));
  options.split_coats = false;
  EXPECT_FALSE(follows(BsdfType::roughconductor, 0.1f, 1 << 20));
}

TEST(FirstHit, DisparityIsTracedOnRequest) {
  const PreparedScene scene = scene_around();
  const Found mirror = look_along(scene, {0, 0, 1});
  EXPECT_EQ(field_query_point(scene.context(), mirror.end.point, OffsetRay{}).disparity, 0.0f);
  EXPECT_NEAR(field_query_point(scene.context(), mirror.end.point, OffsetRay{true, {}}).disparity, 0.25f,
              5e-5f);  // the ray starts a little off the surface
}

}  // namespace
}  // namespace octrad
