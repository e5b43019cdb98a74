// Lights without extent against numbers that Mitsuba 3 computed (tests/mitsuba_world_values.py).
#include <gtest/gtest.h>

#include "octrad/base/folder_test_helper.h"
#include "octrad/image/io.h"
#include "octrad/scene/load.h"
#include "octrad/scene/mitsuba_world_test_data.h"
#include "octrad/shading/lights.h"

namespace octrad {
namespace {

TEST(MitsubaEmitters, DirectionsAndRadiance) {
  const TestFolder folder;
  Image picture(6, 4, {"R", "G", "B"});
  for (int y = 0; y < 4; ++y) {
    for (int x = 0; x < 6; ++x) {
      for (int c = 0; c < 3; ++c)
        picture.at(x, y, c) = static_cast<float>((7 * x + 13 * y + 5 * c + x * y) % 11) / 8.0f;
    }
  }
  write_exr(folder.file("p.exr"), picture);
  std::vector<Scene> scenes;
  for (const char* emitter : kMitsubaEmitters) {
    scenes.push_back(load_scene(folder.write(
        "s.xml", std::string("<scene version=\"3.0.0\"><sensor type=\"perspective\"/><shape type=\"sphere\"/>") +
                     emitter + "</scene>")));
    ASSERT_EQ(scenes.back().delta_lights.size(), 1u);
  }
  int lit = 0;
  for (const MitsubaEmitterValue& v : kMitsubaEmitterValues) {
    const Lights lights(scenes[static_cast<std::size_t>(v.emitter)]);
    const LightSample s = lights.sample(v.x, 0.3f, {0.4f, 0.7f});
    SCOPED_TRACE(std::string(kMitsubaEmitters[v.emitter]) + " from " + std::to_string(v.x.x));
    if (max_component(v.radiance) <= 0.0f) {
      EXPECT_TRUE(!s.valid || max_component(s.radiance) == 0.0f);
      continue;
    }
    ++lit;
    ASSERT_TRUE(s.valid && s.delta);
    EXPECT_EQ(s.pdf, 1.0f);
    const bool far = s.distance >= kEnvironmentDistance;
    EXPECT_TRUE(far || std::fabs(s.distance - v.distance) < 1e-5f * v.distance);
    const Vec3f direction = far ? normalize(v.direction) : v.direction;
    for (int c = 0; c < 3; ++c) {
      EXPECT_NEAR(s.direction[c], direction[c], 1e-5f);
      EXPECT_NEAR(s.radiance[c], v.radiance[c], 2e-4f * v.radiance[c] + 1e-6f);
    }
  }
  EXPECT_GT(lit, 50);
}

}  // namespace
}  // namespace octrad
