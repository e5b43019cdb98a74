// Properties of left-hand-side points.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "octrad/scene/sample_scenes.h"
#include "octrad/transport/furnace_test_helper.h"
#include "octrad/transport/lhs_sampler.h"

namespace octrad {
namespace {

using testing::furnace;
using testing::FurnaceScene;
using testing::kGrey;

TEST(LhsSampler, PointsLieOnSurfacesWithTheViewerOnTheirSide) {
  const FurnaceScene setup(furnace(kGrey, "", R"(<shape type="sphere"><float name="radius" value="0.3"/></shape>)"));
  for (const double keep : {0.0, 1.0}) {
    LhsOptions options;
    options.keep_direction = keep;
    options.poses = keep > 0.0 ? 16 : 0;
    const LhsSampler sampler(setup.prepared, options);
    EXPECT_EQ(sampler.poses().size(), keep > 0.0 ? 16u : 1u);
    std::vector<ShadingPoint> points(1000), again(1000);
    sampler.sample(7, points);
    sampler.sample(7, again);
    for (std::size_t i = 0; i < points.size(); ++i) {
      const SurfacePoint p = surface_point(points[i]);
      EXPECT_FALSE(points[i].black);
      EXPECT_GE(dot(p.n, p.wo), 0.0f);
      EXPECT_NEAR(length(p.wo), 1.0f, 1e-4f);
      EXPECT_LE(max_component(max(p.x, -p.x)), 1.0f + 1e-4f);
      EXPECT_TRUE(p.x == again[i].surface.position);
    }
  }
}

TEST(LhsSampler, PointsByAreaBecomeWalks) {
  const FurnaceScene setup(furnace(kGrey, "", R"(<shape type="sphere"><float name="radius" value="0.3"/></shape>)"));
  LhsOptions mixed, walks;
  mixed.walks = 0.2;
  walks.walks = 1.0;
  std::vector<ShadingPoint> points(300), expected(300);
  const auto equal = [&] {
    std::size_t count = 0;
    for (std::size_t i = 0; i < points.size(); ++i)
      count += points[i].surface.position == expected[i].surface.position && points[i].wo == expected[i].wo;
    return count;
  };
  LhsSampler(setup.prepared, walks).sample(5, expected);
  const LhsSampler sampler(setup.prepared, mixed);
  sampler.sample(5, points, {}, 0.0);
  EXPECT_EQ(equal(), 300u);
  sampler.sample(5, points, {}, 0.5);  // a share of .6 is walks
  EXPECT_NEAR(static_cast<double>(equal()), 180.0, 30.0);
  sampler.sample(5, points);
  EXPECT_NEAR(static_cast<double>(equal()), 60.0, 28.0);
}

// The sensor is behind a lamp that it does not see.
TEST(LhsSampler, WalksPassHiddenEmitters) {
  for (const bool hide : {false, true}) {
    testing::SceneMaker maker;
    const int grey = maker.diffuse(Vec3f(0.5f), true);
    maker.quad({-9, -9, 0}, {18, 0, 0}, {0, 18, 0}, grey);
    maker.quad({-9, -9, 2}, {18, 0, 0}, {0, 18, 0}, grey, Vec3f(3.0f));
    maker.camera({0, 0, 4}, {0, 0, 0}, 20.0f, 20, 20);
    maker.scene.hide_emitters = hide;
    const PreparedScene prepared(std::move(maker.scene));
    LhsOptions options;
    options.walks = 0.0;
    options.view = 1.0;
    std::vector<ShadingPoint> points(500);
    LhsSampler(prepared, options).sample(3, points);
    for (const ShadingPoint& p : points) EXPECT_FLOAT_EQ(p.surface.position.z, hide ? 0.0f : 2.0f);
    options.walks = 1.0;
    options.view = 0.0;
    options.stop_probability = 0.5;
    LhsSampler(prepared, options).sample(3, points);
    const auto floor =
        std::count_if(points.begin(), points.end(), [](const ShadingPoint& p) { return p.surface.position.z < 1.0f; });
    if (hide) EXPECT_GT(floor, 250);
    else EXPECT_EQ(floor, 0);
  }
}

// A sensor that sees something in a hundredth of its film, under a dome of `null` that has nearly all of the area.
TEST(LhsSampler, PointsAreFoundWhereSensorsSeeLittleAndNullSurfacesAreLarge) {
  testing::SceneMaker maker;
  maker.quad({-0.1f, -0.1f, 0}, {0.2f, 0, 0}, {0, 0.2f, 0}, maker.diffuse(Vec3f(0.5f), true));
  Material nothing;
  nothing.type = BsdfType::null;
  maker.sphere({0, 0, 0}, 1000.0f, maker.material(nothing));
  maker.camera({0, 0, 4}, {0, 0, 0}, 40.0f, 20, 20);
  const PreparedScene prepared(std::move(maker.scene));
  for (const double view : {0.0, 0.5, 1.0}) {
    LhsOptions options;
    options.walks = 0.0;
    options.view = view;
    std::vector<ShadingPoint> points(3000);
    LhsSampler(prepared, options).sample(1, points);
    for (const ShadingPoint& p : points) EXPECT_FLOAT_EQ(p.surface.position.z, 0.0f);
  }
}

// A floor, and a sensor of each kind above a part of it of its own.
TEST(LhsSampler, WalksStartFromEveryKindOfSensor) {
  for (const CameraKind kind : {CameraKind::perspective, CameraKind::thinlens, CameraKind::orthographic}) {
    testing::SceneMaker maker;
    maker.quad({-9, -9, 0}, {18, 0, 0}, {0, 18, 0}, maker.diffuse(Vec3f(0.5f)));
    maker.camera({3, 2, 4}, {3, 2, 0}, 20.0f, 20, 20);
    Camera& camera = maker.scene.cameras[0];
    camera.kind = kind;
    camera.aperture_radius = 0.01f;
    camera.focus_distance = 4.0f;
    camera.half_size = {0.7f, 0.7f};
    const PreparedScene prepared(std::move(maker.scene));
    LhsOptions options;
    options.walks = 0.0;
    options.view = 1.0;
    std::vector<ShadingPoint> points(2000);
    LhsSampler(prepared, options).sample(3, points);
    double squares = 0.0;
    for (const ShadingPoint& p : points) {
      EXPECT_LT(std::fabs(p.surface.position.x - 3.0f), 0.72f);
      EXPECT_LT(std::fabs(p.surface.position.y - 2.0f), 0.72f);
      squares += std::pow(static_cast<double>(p.surface.position.x) - 3.0, 2.0);
      if (kind == CameraKind::orthographic) {
        EXPECT_EQ(p.wo, Vec3f(0, 0, 1));
      }
    }
    EXPECT_NEAR(std::sqrt(3.0 * squares / 2000.0), 0.7, 0.02) << "uniform over the film";
    options.view = 0.0;
    options.walks = 1.0;
    LhsSampler(prepared, options).sample(3, points);
  }
}

TEST(LhsSampler, WalksStartFromAllSensors) {
  // Two closed rooms with a sensor in each: no walk from one of them reaches the other.
  testing::SceneMaker maker;
  const auto room = [&](float x) {
    const int grey = maker.diffuse(Vec3f(0.5f), true);
    for (const float side : {-1.0f, 1.0f}) {
      maker.quad({x + side, -1, -1}, {0, 2, 0}, {0, 0, 2}, grey);
      maker.quad({x - 1, side, -1}, {2, 0, 0}, {0, 0, 2}, grey);
      maker.quad({x - 1, -1, side}, {2, 0, 0}, {0, 2, 0}, grey);
    }
    maker.camera({x, 0, 0}, {x, 0, 1}, 60.0f, 8, 8);
  };
  room(0.0f);
  room(10.0f);
  const PreparedScene prepared(std::move(maker.scene));
  for (const int poses : {0, 64}) {
    LhsOptions options;
    options.walks = 1.0;
    options.poses = poses;
    std::vector<ShadingPoint> points(2000);
    LhsSampler(prepared, options).sample(3, points);
    const auto second =
        std::count_if(points.begin(), points.end(), [](const ShadingPoint& p) { return p.surface.position.x > 5.0f; });
    SCOPED_TRACE(poses);
    EXPECT_NEAR(static_cast<double>(second) / 2000.0, 0.5, 0.15);
  }
}

TEST(LhsSampler, GlossyPointsCanBeFavouredAndSeenUniformly) {
  const FurnaceScene setup(furnace(
      kGrey, "",
      R"(<shape type="sphere"><float name="radius" value="0.6"/><bsdf type="roughconductor"><float name="alpha" value="0.1"/></bsdf></shape>)"));
  const auto glossy = [&](double boost, bool uniform) {
    LhsOptions options;
    options.walks = 0.0;
    options.glossy_boost = boost;
    options.uniform_glossy = uniform;
    std::vector<ShadingPoint> points(6000);
    LhsSampler(setup.prepared, options).sample(1, points);
    double count = 0.0, cosine = 0.0;
    for (const ShadingPoint& p : points) {
      if (roughness_bsdf(p.bsdf) >= 0.5f) continue;
      count += 1.0;
      cosine += static_cast<double>(dot(p.ns, p.wo));
    }
    return std::pair{count / 6000.0, cosine / count};
  };
  // The sphere's outside against the box's inside, by area (samples on the black side of either are drawn again).
  const double share = 4.0 * 3.14159265 * 0.36 / (4.0 * 3.14159265 * 0.36 + 24.0);
  const auto [plain, mean_cosine] = glossy(1.0, false);
  // 5 standard deviations; a cosine of density 2 c has variance 1 / 18, a uniform one 1 / 12.
  const auto share_error = [](double p) { return 5.0 * std::sqrt(p * (1.0 - p) / 6000.0); };
  EXPECT_NEAR(plain, share, share_error(share));
  EXPECT_NEAR(mean_cosine, 2.0 / 3.0, 5.0 * std::sqrt(1.0 / 18.0 / (6000.0 * plain)));
  const auto [boosted, mean_uniform] = glossy(3.0, true);
  const double boosted_share = 3.0 * share / (3.0 * share + 1.0 - share);
  EXPECT_NEAR(boosted, boosted_share, share_error(boosted_share));
  EXPECT_NEAR(mean_uniform, 0.5, 5.0 * std::sqrt(1.0 / 12.0 / (6000.0 * boosted)));
}

TEST(LhsSampler, WalksStopAtGlossySurfacesMoreReadily) {
  const FurnaceScene setup(
      furnace(kGrey, "",
              R"(<shape type="sphere"><point name="center" x="0.4" y="0.3" z="0.4"/><float name="radius" value="0.4"/>
         <bsdf type="roughconductor"><float name="alpha" value="0.1"/></bsdf></shape>)"));
  const auto glossy = [&](double boost) {
    LhsOptions options;
    options.walks = 1.0;
    options.stop_probability = 0.6;
    options.glossy_boost = boost;
    std::vector<ShadingPoint> points(6000);
    LhsSampler(setup.prepared, options).sample(1, points);
    return static_cast<double>(std::count_if(points.begin(), points.end(),
                                             [](const ShadingPoint& p) { return roughness_bsdf(p.bsdf) < 0.5f; })) /
           6000.0;
  };
  // Long walks meet the sphere at a share p of their vertices, and stop there with odds of boost p : 1 - p.
  const double p = glossy(1.0), odds = p / (1.0 - p), boosted = glossy(3.0);
  EXPECT_GT(p, 0.02);
  EXPECT_NEAR(boosted / (1.0 - boosted) / odds, 3.0, 0.6);
}

// Nobody asks about surfaces that rays follow, unless the scene has nothing else.
TEST(LhsSampler, FollowedSurfacesAreNoPoints) {
  const std::string metal = R"(<bsdf type="roughconductor"><float name="alpha" value="0.3"/></bsdf>)";
  const FurnaceScene mixed(furnace(
      kGrey, "",
      R"(<shape type="sphere"><point name="center" x="0.4" y="0.3" z="0.4"/><float name="radius" value="0.4"/>)" +
          metal + "</shape>"));
  LhsOptions options;
  const auto followed = [&](const FurnaceScene& setup, double walks, float follow_below) {
    options.walks = walks;
    options.follow_below = follow_below;
    std::vector<ShadingPoint> points(2000);
    LhsSampler(setup.prepared, options).sample(1, points);
    return std::count_if(points.begin(), points.end(),
                         [&](const ShadingPoint& p) { return is_followed(p.bsdf, 0.4f); });
  };
  for (const double walks : {0.0, 1.0}) {
    EXPECT_GT(followed(mixed, walks, 0.0f), 50);
    EXPECT_GT(followed(mixed, walks, 0.3f), 50);  // below is exclusive
    EXPECT_EQ(followed(mixed, walks, 0.31f), 0);
  }
  EXPECT_EQ(followed(FurnaceScene(furnace(metal, "")), 0.9, 0.31f), 2000);
}

TEST(LhsSampler, AreaPointsAreUniform) {
  const FurnaceScene setup(furnace(kGrey, ""));
  LhsOptions options;
  options.walks = 0.0;
  std::vector<ShadingPoint> points(12000);
  LhsSampler(setup.prepared, options).sample(0, points);
  int faces[6] = {};
  for (const ShadingPoint& p : points) {
    for (int a = 0; a < 3; ++a) {
      if (p.surface.position[a] > 0.9999f) ++faces[2 * a];
      if (p.surface.position[a] < -0.9999f) ++faces[2 * a + 1];
    }
  }
  for (const int f : faces) EXPECT_NEAR(f, 2000, 5 * 41);  // 5 standard deviations
}

}  // namespace
}  // namespace octrad
