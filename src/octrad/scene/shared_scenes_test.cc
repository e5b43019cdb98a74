// The shared scenes: counts as their files state them, the same at any thread count.
#include <gtest/gtest.h>

#include <filesystem>

#include "octrad/base/threads.h"
#include "octrad/scene/files_test_helper.h"
#include "octrad/scene/load.h"

namespace octrad {
namespace {

TEST(SharedScenes, AllLoad) {
  const std::filesystem::path scenes = shared_folder() / "scenes";
  if (!std::filesystem::is_directory(scenes)) GTEST_SKIP() << "no shared scenes at " << scenes;
  struct Expected {
    const char* file;
    std::size_t shapes, triangles, lights, environments;
  };
  for (const Expected& e :
       {Expected{"bathroom/scene.xml", 854, 380938, 9, 0}, Expected{"bathroom/scene_origmat.xml", 854, 380938, 1, 0},
        Expected{"cbox-mitsuba/scene.xml", 8, 12, 1, 0}, Expected{"cornell-box/scene.xml", 10, 169702, 1, 0},
        Expected{"cornell-box/scene_origmat.xml", 8, 36, 1, 0}, Expected{"kitchen/scene.xml", 293, 1025965, 4, 0},
        Expected{"kitchen/scene_origmat.xml", 296, 1054061, 4, 0}, Expected{"living-room/scene.xml", 65, 143163, 0, 1},
        Expected{"living-room/scene_origmat.xml", 65, 143163, 0, 1}, Expected{"veach-ajar/scene.xml", 22, 226114, 1, 0},
        Expected{"veach-ajar/scene_origmat.xml", 22, 226114, 1, 0}}) {
    const Scene scene = load_scene((scenes / e.file).string());
    EXPECT_EQ(scene.shapes.size(), e.shapes) << e.file;
    EXPECT_EQ(scene.triangle_count(), e.triangles) << e.file;
    EXPECT_EQ(scene.area_lights.size(), e.lights) << e.file;
    EXPECT_EQ(scene.environments.size(), e.environments) << e.file;
    EXPECT_TRUE(scene.warnings.empty()) << e.file << ": " << scene.warnings.front();
  }
  const std::string file = (scenes / "veach-ajar/scene.xml").string(), once = load_scene(file).fingerprint;
  set_thread_count(1);
  EXPECT_EQ(load_scene(file).fingerprint, once);
  set_thread_count(0);
}

}  // namespace
}  // namespace octrad
