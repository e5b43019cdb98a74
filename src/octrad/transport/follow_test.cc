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

}  // namespace
}  // namespace octrad
