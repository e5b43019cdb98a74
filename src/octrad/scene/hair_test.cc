// Parameters of `hair` in scene files. The model itself is tested in shading/bsdf_test.cc and
// shading/mitsuba_scattering_test.cc.
#include <gtest/gtest.h>

#include <cmath>

#include "octrad/base/error.h"
#include "octrad/base/folder_test_helper.h"
#include "octrad/scene/load.h"

namespace octrad {
namespace {

Scene hair_scene(const std::string& parameters) {
  const TestFolder folder;
  return load_scene(folder.write("s.xml", R"(<scene version="3.0.0"><sensor type="perspective"/>
<shape type="sphere"><bsdf type="hair">
)" + parameters + "</bsdf></shape></scene>"));
}

Vec3f texture_of(const Scene& scene, int index) { return scene.textures.at(static_cast<std::size_t>(index)).color0; }

// What a radius leaves of light.
Vec3f hair_transmittance(const std::string& parameters) {
  const Scene scene = hair_scene(parameters);
  return texture_of(scene,
                    scene.materials.at(static_cast<std::size_t>(scene.shapes.at(0).material)).specular_transmittance);
}

std::string hair_error(const std::string& parameters) {
  try {
    hair_scene(parameters);
  } catch (const InputError& e) {
    return e.what();
  }
  return "";
}

TEST(Hair, Absorption) {
  const auto expect_near = [](Vec3f found, Vec3d absorption) {
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(found[c], std::exp(-absorption[c]), 1e-6) << c;
  };
  expect_near(hair_transmittance(""), Vec3d(0.419, 0.697, 1.37) * 1.3 + Vec3d(0.187, 0.4, 1.05) * 0.2);
  expect_near(hair_transmittance(R"(<float name="eumelanin" value="0"/><float name="pheomelanin" value="2"/>)"),
              Vec3d(0.187, 0.4, 1.05) * 2.0);
  expect_near(hair_transmittance(R"(<rgb name="sigma_a" value=".1 .2 3"/><float name="scale" value="2"/>)"),
              Vec3d(0.2, 0.4, 6.0));
  EXPECT_EQ(hair_transmittance(R"(<float name="sigma_a" value="1e30"/>)"), Vec3f(0.0f));
}

TEST(Hair, Defaults) {
  const Scene scene = hair_scene("");
  const Material& m = scene.materials.at(static_cast<std::size_t>(scene.shapes.at(0).material));
  EXPECT_NEAR(m.int_ior / m.ext_ior, 1.55f / 1.000277f, 1e-6f);
  EXPECT_EQ(texture_of(scene, m.extra[ExtraParameter::roughness]), Vec3f(0.3f));
  EXPECT_EQ(texture_of(scene, m.extra[ExtraParameter::azimuthal_roughness]), Vec3f(0.3f));
  EXPECT_EQ(texture_of(scene, m.extra[ExtraParameter::scale_tilt]), Vec3f(2.0f));
}

TEST(Hair, Mistakes) {
  const auto refuses = [](const std::string& parameters, const std::string& place, const std::string& what) {
    const std::string message = hair_error(parameters);
    EXPECT_NE(message.find("s.xml:" + place + ":"), std::string::npos) << message;
    EXPECT_NE(message.find(what), std::string::npos) << message;
  };
  refuses(R"(<float name="longitudinal_roughness" value="1.1"/>)", "3:1", "must be between 0 and 1");
  refuses(R"(<float name="azimuthal_roughness" value="nan"/>)", "3:1", "is not a finite number");
  refuses(R"(<float name="eumelanin" value="-1"/>)", "3:1", "must be between 0 and");
  refuses(R"(<float name="pheomelanin" value="1"/><rgb name="sigma_a" value="1 2 3"/>)", "3:38",
          "sigma_a, or eumelanin and pheomelanin, not both");
  refuses(R"(<rgb name="sigma_a" value="1 -1 0"/>)", "3:1", "an absorption must be finite and not negative");
  refuses(R"(<texture name="sigma_a" type="checkerboard"/>)", "3:1", "must be a constant");
  refuses(R"(<float name="int_ior" value="1.2"/><float name="ext_ior" value="1.2"/>)", "3:1", "differs from ext_ior");
  refuses(R"(<float name="alpha" value="1"/>)", "3:1", "unknown parameter \"alpha\"");
}

}  // namespace
}  // namespace octrad
