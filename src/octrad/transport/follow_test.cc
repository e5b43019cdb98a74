// Rays through masks and over mirrors and glass.
#include <gtest/gtest.h>

#include "octrad/transport/furnace_test_helper.h"

namespace octrad {
namespace {

using testing::furnace;
using testing::FurnaceScene;
using testing::kGrey;

TEST(FollowRay, EmissionOfTheEndIsToldFromWhatWasPassed) {
  // Two lamps above the origin, the nearer one behind a mask that lets everything pass.
  const FurnaceScene setup(furnace(
      kGrey, "",
      R"(<shape type="rectangle"><transform name="to_world"><rotate x="1" angle="180"/><translate z="0.3"/></transform>
    <bsdf type="mask"><float name="opacity" value="0"/><bsdf type="diffuse"/></bsdf><emitter type="area"><rgb name="radiance" value="2"/></emitter></shape>
    <shape type="rectangle"><transform name="to_world"><rotate x="1" angle="180"/><translate z="0.6"/></transform>
    <emitter type="area"><rgb name="radiance" value="5"/></emitter></shape>)"));
  Rng rng(1, RngPurpose::test, 0);
  const RayEnd end =
      follow_ray(setup.context, Vec3f(0.1f, 0.2f, 0.0f), nullptr, Vec3f(0.0f, 0.0f, 1.0f), rng, 0.0f, 16);
  ASSERT_TRUE(end.surface);
  EXPECT_FLOAT_EQ(end.first_emitted.x + end.emitted.x, 7.0f);
  EXPECT_FLOAT_EQ(end.passed_emitted.x, 2.0f);
  EXPECT_FLOAT_EQ(end.own_emitted.x, 5.0f);
}

const std::string kBlack = R"(<bsdf type="diffuse"><rgb name="reflectance" value="0"/></bsdf>)";

// A lamp in the lobe of a rough metal. At 60 degrees one direction in eleven that is drawn from the lobe lies below the
// surface; what light sampling finds must not be lost with it.
TEST(FollowRay, LightsAreSampledWhereNoDirectionIsDrawn) {
  const FurnaceScene setup(
      furnace(kBlack, "",
              R"(<shape type="rectangle"><transform name="to_world"><scale value="0.2"/></transform>
    <bsdf type="roughconductor"><string name="distribution" value="ggx"/><float name="alpha" value="0.3"/></bsdf></shape>
    <shape type="rectangle"><transform name="to_world"><scale value="0.005"/><lookat origin="-0.34641016, 0, 0.2" target="0, 0, 0" up="0, 1, 0"/></transform>
    <emitter type="area"><rgb name="radiance" value="1000"/></emitter></shape>)"));
  const Vec3f from{0.34641016f, 0.0f, 0.2f}, lamp{-0.34641016f, 0.0f, 0.2f};
  Rng first(1, RngPurpose::test, 0);
  const ShadingPoint point = follow_ray(setup.context, from, nullptr, normalize(-from), first, 0.0f, 4).point;
  const BsdfValue f = evaluate_bsdf(point.bsdf, point.to_local(point.wo), point.to_local(normalize(lamp)));
  const double expected = static_cast<double>(f.value.x) * 1000.0 * (0.01 * 0.01) / dot(lamp, lamp);
  double sum = 0.0;
  constexpr int kRays = 20000;
  for (int i = 0; i < kRays; ++i) {
    Rng rng(2, RngPurpose::test, static_cast<std::uint64_t>(i));
    sum += static_cast<double>(follow_ray(setup.context, from, nullptr, normalize(-from), rng, 0.5f, 4).emitted.x);
  }
  EXPECT_NEAR(sum / kRays, expected, 0.03 * expected);
}

// Masks do not count as mirrors, whose number `max_chain` bounds.
TEST(FollowRay, ManyMasksArePassed) {
  const auto planes = [](int masks) {
    std::string text;
    for (int i = 0; i < masks; ++i) {
      text +=
          R"(<shape type="rectangle"><transform name="to_world"><translate z=")" + std::to_string(0.002 * (i + 1)) +
          R"("/></transform><bsdf type="mask"><float name="opacity" value="0"/><bsdf type="diffuse"/></bsdf></shape>)";
    }
    return text;
  };
  for (const int masks : {40, 300}) {
    const FurnaceScene setup(furnace(kGrey, "", planes(masks)));
    Rng rng(1, RngPurpose::test, 0);
    const RayEnd end = follow_ray(setup.context, Vec3f(0.1f, 0.2f, 0.0f), nullptr, Vec3f(0, 0, 1), rng, 0.0f, 16);
    EXPECT_EQ(end.surface, masks == 40);
    EXPECT_EQ(end.rays, masks == 40 ? 41 : 16 + kMostMasks + 1);
  }
}

// What a mask keeps of a one-sided surface is black from behind.
TEST(FollowRay, TheBackOfAMaskedSurfaceIsBlack) {
  const FurnaceScene setup(furnace(
      kGrey, "",
      R"(<shape type="rectangle"><bsdf type="mask"><float name="opacity" value="0.5"/><bsdf type="diffuse"/></bsdf></shape>)"));
  int kept = 0, passed = 0;
  for (int i = 0; i < 200; ++i) {
    Rng rng(3, RngPurpose::test, static_cast<std::uint64_t>(i));
    const RayEnd back = follow_ray(setup.context, Vec3f(0.1f, 0.2f, -0.5f), nullptr, Vec3f(0, 0, 1), rng, 0.0f, 4);
    if (back.rays == 1) ++kept;
    else ++passed;
    EXPECT_EQ(back.surface, back.rays > 1);
    Rng other(4, RngPurpose::test, static_cast<std::uint64_t>(i));
    EXPECT_TRUE(follow_ray(setup.context, Vec3f(0.1f, 0.2f, 0.5f), nullptr, Vec3f(0, 0, -1), other, 0.0f, 4).surface);
  }
  EXPECT_GT(kept, 60);
  EXPECT_GT(passed, 60);
}

}  // namespace
}  // namespace octrad
