// For tests of the pbrt reader: files beside Mitsuba files that say the same.
#pragma once

#include <gtest/gtest.h>

#include <string>

#include "octrad/base/error.h"
#include "octrad/base/folder_test_helper.h"
#include "octrad/base/join.h"
#include "octrad/scene/load.h"

namespace octrad {

inline const std::string kPbrtSphere = "Shape \"sphere\"\n";
inline const std::string kPbrtSquare =
    "Shape \"trianglemesh\" \"point3 P\" [0 0 0 1 0 0 1 1 0 0 1 0] \"integer indices\" [0 1 2 0 2 3] "
    "\"point2 uv\" [0 0 1 0 1 1 0 1]\n";

class PbrtTest : public ::testing::Test {
 protected:
  Scene load(const std::string& world, const std::string& before = "") const {
    return load_scene(folder_.write("s.pbrt", before + "WorldBegin\n" + world));
  }
  Scene load_old(const std::string& world) const { return load(world + "\nWorldEnd\n"); }
  Scene load_xml(const std::string& body) const {
    return load_scene(folder_.write("s.xml", "<scene version=\"3.0.0\">\n" + body + "</scene>\n"));
  }
  static std::string on_sphere(const std::string& bsdf) { return "<shape type=\"sphere\">" + bsdf + "</shape>\n"; }
  // A sphere of that material, and one of that bsdf.
  void same_material(const std::string& pbrt, const std::string& bsdf, bool old = false) const {
    const Scene scene = old ? load_old(pbrt + kPbrtSphere) : load(pbrt + kPbrtSphere);
    EXPECT_EQ(scene.fingerprint, load_xml(on_sphere(bsdf)).fingerprint) << pbrt;
  }
  static std::string two_sided(const std::string& bsdf) { return "<bsdf type=\"twosided\">" + bsdf + "</bsdf>"; }
  std::string error(const std::string& text) const {
    try {
      load_scene(folder_.write("s.pbrt", text));
    } catch (const Error& e) {
      return e.what();
    }
    return "no error";
  }
  void fails(const std::string& text, const std::string& where, const std::string& what) const {
    const std::string message = error(text);
    EXPECT_NE(message.find("s.pbrt:" + where + ":"), std::string::npos) << message;
    EXPECT_NE(message.find(what), std::string::npos) << message;
  }
  void assumes(const Scene& scene, const std::string& what) const {
    EXPECT_NE(join(scene.assumed, "\n").find(what), std::string::npos) << join(scene.assumed, "\n");
  }
  TestFolder folder_;
};

inline void expect_near(Vec3d a, Vec3d b, double tolerance = 1e-5) {
  for (int c = 0; c < 3; ++c) EXPECT_NEAR(a[c], b[c], tolerance);
}

}  // namespace octrad
