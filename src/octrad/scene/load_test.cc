// What scene files may contain, and the errors for everything else.
#include "octrad/scene/load.h"

#include <gtest/gtest.h>

#include <cmath>

#include "octrad/base/error.h"
#include "octrad/base/join.h"
#include "octrad/base/rng.h"
#include "octrad/image/io.h"
#include "octrad/scene/files_test_helper.h"

namespace octrad {
namespace {

const std::string kSensor = "<sensor type=\"perspective\"><float name=\"fov\" value=\"60\"/></sensor>";
const std::string kSphere = "<shape type=\"sphere\"/>";

std::string scene_text(const std::string& body) { return "<scene version=\"3.0.0\">\n" + body + "\n</scene>\n"; }

class LoadTest : public ::testing::Test {
 protected:
  // Loads a scene with the given elements; a sensor and a shape are added unless `complete`.
  Scene load(const std::string& body, const LoadOptions& options = {}) const {
    return load_scene(folder_.write("s.xml", scene_text(body + "\n" + kSensor + kSphere)), options);
  }
  Scene load_whole(const std::string& body) const { return load_scene(folder_.write("s.xml", scene_text(body))); }

  // The first material that the file defines.
  Material bsdf(const std::string& element) const {
    const Scene scene = load(element);
    return scene.materials.at(scene.materials.size() > 1 ? scene.materials.size() - 1 : 0);
  }
  Vec3f color(const std::string& element) const {
    const Scene scene = load(element);
    return evaluate_texture(
        texture_view(scene.textures.at(static_cast<std::size_t>(scene.materials.at(1).reflectance))), {0, 0});
  }
  // Positions of a mesh with the corners (1,0,0), (0,1,0), (0,0,1) after a transform.
  std::vector<Vec3f> transformed(const std::string& operations) const {
    folder_.write("p.obj", "v 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\n");
    return load_whole(kSensor +
                      R"(<shape type="obj"><string name="filename" value="p.obj"/><transform name="to_world">)" +
                      operations + "</transform></shape>")
        .meshes.at(0)
        .positions;
  }
  void expect_points(const std::string& operations, const std::vector<Vec3f>& expected) const {
    const std::vector<Vec3f> found = transformed(operations);
    ASSERT_EQ(found.size(), expected.size());
    for (std::size_t i = 0; i < found.size(); ++i)
      EXPECT_LT(length(found[i] - expected[i]), 1e-6f) << operations << " point " << i;
  }

  std::string error(const std::string& body) const {
    try {
      load(body);
    } catch (const Error& e) {
      return strip(e.what());
    }
    return "no error";
  }
  std::string error_whole(const std::string& text, const LoadOptions& options = {}) const {
    try {
      load_scene(folder_.write("s.xml", text), options);
    } catch (const Error& e) {
      return strip(e.what());
    }
    return "no error";
  }
  // Expects the message to begin with s.xml:LINE:COLUMN and to contain all the parts.
  void refuses(const std::string& body, const std::string& place, std::initializer_list<std::string> parts) const {
    const std::string message = error(body);
    EXPECT_EQ(message.rfind("s.xml:" + place + ": ", 0), 0u) << message;
    for (const std::string& part : parts)
      EXPECT_NE(message.find(part), std::string::npos) << "\"" << part << "\" not in: " << message;
  }

  // Without the name of the folder.
  std::string strip(std::string message) const {
    const std::string prefix = folder_.file("");
    for (std::size_t at; (at = message.find(prefix)) != std::string::npos;) message.erase(at, prefix.size());
    return message;
  }

  TestFolder folder_;
};

TEST_F(LoadTest, Defaults) {
  const Scene scene = load("");
  EXPECT_EQ(scene.film.width, 768);
  EXPECT_EQ(scene.film.height, 576);
  EXPECT_EQ(scene.film.filter, Film::Filter::gaussian);
  EXPECT_EQ(scene.film.filter_radius, 2.0f);
  EXPECT_EQ(scene.max_depth, -1);
  EXPECT_EQ(scene.shapes[0].material, 0);
  EXPECT_EQ(
      evaluate_texture(texture_view(scene.textures[static_cast<std::size_t>(scene.materials[0].reflectance)]), {0, 0}),
      Vec3f(0.5f));
  EXPECT_EQ(scene.bounds.lower, Vec3f(-1, -1, -1));
  EXPECT_EQ(scene.bounds.upper, Vec3f(1, 1, 1));
  EXPECT_EQ(scene.fingerprint.size(), 16u);
  EXPECT_EQ(scene.warnings.size(), 1u);
  EXPECT_NE(join(scene.warnings).find("s.xml:1:1: the scene has no emitter: everything is black"), std::string::npos);
  EXPECT_TRUE(load(R"(<emitter type="constant"/>)").warnings.empty());
}

TEST_F(LoadTest, Parameters) {
  const std::string body =
      R"(<default name="r" value="0.25"/><default name="r" value="0.75"/><default name="both" value="$r, $r, 1"/>
    <bsdf type="diffuse"><rgb name="reflectance" value="$both"/></bsdf>)";
  EXPECT_EQ(color(body), Vec3f(0.25f, 0.25f, 1.0f));
  LoadOptions options;
  options.definitions = {{"r", "0.5"}};
  const Scene scene = load(body, options);
  EXPECT_EQ(
      evaluate_texture(texture_view(scene.textures[static_cast<std::size_t>(scene.materials[1].reflectance)]), {0, 0}),
      Vec3f(0.5f, 0.5f, 1.0f));

  refuses(R"(<default name="spp" value="1"/><bsdf type="diffuse"><float name="reflectance" value="$sp"/></bsdf>)",
          "2:53", {"undefined parameter $sp", "did you mean \"spp\"", "-D sp=value"});
  options.definitions = {{"sppp", "3"}};
  EXPECT_NE(error_whole(scene_text(R"(<default name="spp" value="1"/>)" + kSensor + kSphere), options)
                .find("has no parameter \"sppp\" (did you mean \"spp\"?); it has: spp"),
            std::string::npos);
  options.definitions = {{"x", "0.5"}};  // used without a default
  EXPECT_EQ(error_whole(
                scene_text(R"(<bsdf type="diffuse"><float name="reflectance" value="$x"/></bsdf>)" + kSensor + kSphere),
                options),
            "no error");
  // What changes nothing is told.
  options.definitions = {{"spp", "3"}, {"idle", "1"}, {"depth", "2"}, {"kind", "direct"}};
  const Scene warned =
      load(R"(<default name="spp" value="1"/><default name="idle" value="1"/><default name="depth" value="1"/>
    <default name="kind" value="path"/><emitter type="point"/><integrator type="$kind"><integer name="max_depth" value="$depth"/></integrator>
    <sensor type="perspective"><sampler type="independent"><integer name="sample_count" value="$spp"/></sampler></sensor>)",
           options);
  ASSERT_EQ(warned.warnings.size(), 3u);
  EXPECT_NE(warned.warnings[0].find("-D idle=1 changes nothing: the scene file does not use"), std::string::npos);
  EXPECT_NE(warned.warnings[1].find("-D kind=direct changes nothing: the scene file uses it for its"),
            std::string::npos);
  EXPECT_NE(warned.warnings[2].find("-D spp=3 changes nothing: the scene file uses it for its"), std::string::npos);
  EXPECT_EQ(warned.max_depth, 2);
  refuses(R"(<default name="" value="1"/>)", "2:1", {"an empty name"});
  // The longest name that fits, whatever comes after it; an escaped dollar sign.
  EXPECT_EQ(color(R"(<default name="a" value="0"/><default name="a-b" value="0.5"/>
    <bsdf type="diffuse"><rgb name="reflectance" value="$a-b 0 $a.25"/></bsdf>)"),
            Vec3f(0.5f, 0.0f, 0.25f));
  // Of names that go on differently from what is there, the one that both begin with.
  EXPECT_EQ(
      color(
          R"(<default name="c" value="0."/><default name="cc" value="0."/><default name="ccb" value="9"/><default name="cc31" value="9"/>
    <bsdf type="diffuse"><rgb name="reflectance" value="$cc5 $cc32 $c25"/></bsdf>)"),
      Vec3f(0.5f, 0.32f, 0.25f));
  refuses(R"(<shape type="obj"><string name="filename" value="\$a.obj"/></shape>)", "2:19", {"\"$a.obj\""});
  refuses(R"(<default name="a"/>)", "2:1", {"needs the attribute \"value\""});
}

TEST_F(LoadTest, BrokenIncludesAliasesAndPaths) {
  refuses(R"(<alias id="nothing" as="b"/>)", "2:1", {"nothing has the id \"nothing\""});
  refuses(R"(<include filename="none.xml"/>)", "2:1", {"\"none.xml\" does not exist"});
  refuses(R"(<path value="none"/>)", "2:1", {"is not a folder"});
}

TEST_F(LoadTest, IncludesThatNeverEnd) {
  folder_.write("self.xml", R"(<scene version="3.0.0"><include filename="self.xml"/></scene>)");
  EXPECT_NE(error(R"(<include filename="self.xml"/>)").find("includes itself"), std::string::npos);
  folder_.write("a.xml", R"(<scene version="3.0.0"><include filename="b.xml"/></scene>)");
  folder_.write("b.xml", R"(<scene version="3.0.0"><include filename="a.xml"/></scene>)");
  EXPECT_NE(error(R"(<include filename="a.xml"/>)").find("includes itself"), std::string::npos);
  EXPECT_NE(error(R"(<include filename="s.xml"/>)").find("includes itself"), std::string::npos);
  // Each file includes the next ten times: 10^12 in all.
  for (int i = 0; i < 12; ++i) {
    std::string text = "<scene version=\"3.0.0\">";
    for (int k = 0; k < 10; ++k) text += "<include filename=\"l" + std::to_string(i + 1) + ".xml\"/>";
    folder_.write("l" + std::to_string(i) + ".xml", text + "</scene>");
  }
  folder_.write("l12.xml", "<scene version=\"3.0.0\"/>");
  EXPECT_NE(error(R"(<include filename="l0.xml"/>)").find("more than 1000 files"), std::string::npos);
  // Values that double at every step.
  std::string doubling = R"(<default name="v0" value="0123456789"/>)";
  for (int i = 0; i < 60; ++i)
    doubling += "<default name=\"v" + std::to_string(i + 1) + "\" value=\"$v" + std::to_string(i) + "$v" +
                std::to_string(i) + "\"/>";
  EXPECT_NE(error(doubling).find("longer than"), std::string::npos);
  // XML entities are not expanded.
  EXPECT_NE(error_whole("<!DOCTYPE x [<!ENTITY a \"aaaaaaaaaa\"><!ENTITY b \"&a;&a;\">]>" + scene_text("&b;")),
            "no error");
}

TEST_F(LoadTest, DeepNesting) {
  std::string deep;
  for (int i = 0; i < 100000; ++i) deep += "<bsdf type=\"twosided\">";
  EXPECT_NE(error_whole("<scene version=\"3.0.0\">" + deep + "</scene>"), "no error");
  std::string closed = "<bsdf type=\"diffuse\"/>";
  for (int i = 0; i < 5000; ++i) closed = "<bsdf type=\"twosided\">" + closed + "</bsdf>";
  EXPECT_NE(error(closed).find("nested more than 64 deep"), std::string::npos);
}

TEST_F(LoadTest, TruncatedFiles) {
  const std::string text = scene_text(
      R"(<default name="a" value="1"/><!-- note --><bsdf type="twosided" id="m"><bsdf type="diffuse"><rgb name="reflectance" value="0.1 0.2 $a"/></bsdf></bsdf>)" +
      kSensor + R"(<shape type="cube"><transform name="to_world"><scale value="2"/></transform><ref id="m"/></shape>)");
  EXPECT_EQ(error_whole(text), "no error");
  for (std::size_t n = 0; n < text.find("</scene>") + 8; n += 2) {
    const std::string message = error_whole(text.substr(0, n));
    EXPECT_EQ(message.rfind("s.xml:", 0), 0u) << n << ": " << message;
  }
  int refused = 0;
  for (std::uint64_t i = 0; i < 300; ++i) {
    Rng rng(11, RngPurpose::test, i);
    std::string broken = text;
    for (std::uint32_t k = 0, n = 1 + rng.below(3); k < n; ++k)
      broken[rng.below(static_cast<std::uint32_t>(broken.size()))] = static_cast<char>(rng.below(256));
    refused += error_whole(broken) != "no error";  // must not crash; most are refused
  }
  EXPECT_GT(refused, 150);
}

TEST_F(LoadTest, Transforms) {
  // Mitsuba 3.9.1's positions.
  expect_points(R"(<rotate z="1" angle="40"/>)",
                {{0.76604444f, 0.64278764f, 0}, {-0.64278764f, 0.76604444f, 0}, {0, 0, 1}});
  expect_points(R"(<scale value="2"/>)", {{2, 0, 0}, {0, 2, 0}, {0, 0, 2}});
  expect_points(R"(<scale value="2, 3, 4"/>)", {{2, 0, 0}, {0, 3, 0}, {0, 0, 4}});
  expect_points(R"(<scale x="2"/>)", {{2, 0, 0}, {0, 1, 0}, {0, 0, 1}});
  expect_points(R"(<translate x="1"/><scale value="2"/>)", {{4, 0, 0}, {2, 2, 0}, {2, 0, 2}});
  expect_points(R"(<translate value="1 2 3"/>)", {{2, 2, 3}, {1, 3, 3}, {1, 2, 4}});
  expect_points(R"(<matrix value="1 2 3 4 5 6 7 8 9 10 12 12 0 0 0 1"/>)", {{5, 13, 21}, {6, 14, 22}, {7, 15, 24}});
  expect_points(R"(<matrix value="1 2 3 4 5 6 7 8 10"/>)", {{1, 4, 7}, {2, 5, 8}, {3, 6, 10}});
  for (const std::string name : {"lookat", "lookAt"}) {
    expect_points(
        "<" + name + R"( origin="1 2 3" target="0 0 1" up="0 1 0"/>)",
        {{0.10557282f, 2, 3.4472136f}, {0.70185757f, 2.745356f, 2.4037151f}, {0.6666666f, 1.3333333f, 2.3333333f}});
  }
  // Without `up`, Mitsuba's choice (its matrix for this file, version 3.9.1).
  for (const std::string up : {"", R"( up="0 0 0")"}) {
    expect_points(R"(<lookat origin="0 0 0" target="1 2 2")" + up + "/>", {{0.13333333f, -0.73333333f, 0.66666667f},
                                                                           {0.93333333f, -0.13333333f, -0.33333333f},
                                                                           {0.33333333f, 0.66666667f, 0.66666667f}});
  }
  expect_points(R"(<translate value="2"/>)", {{3, 2, 2}, {2, 3, 2}, {2, 2, 3}});
  expect_points(R"(<matrix value="1 0 0 0 0 1 0 0 0 0 1 0 1e-9 0 0 0.999999"/>)", {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}});
  // A rotation whatever the length of its axis, and a remark.
  const std::vector<Vec3f> p = transformed(R"(<rotate value="1 2 3" angle="40"/>)");
  EXPECT_NEAR(length(p[0]), 1.0f, 1e-6f);
  EXPECT_NEAR(dot(p[0], p[1]), 0.0f, 1e-6f);
  expect_points(R"(<rotate value="1" angle="40"/>)", transformed(R"(<rotate value="1 1 1" angle="40"/>)"));
  EXPECT_EQ(load(R"(<shape type="cube"><transform name="to_world"><rotate x="2" angle="40"/></transform></shape>
    <emitter type="point"/>)")
                .warnings.size(),
            1u);

  const auto shape = [](const std::string& operations) {
    return "<shape type=\"cube\"><transform name=\"to_world\">\n" + operations + "</transform></shape>";
  };
  refuses(shape(R"(<rotate angle="3"/>)"), "3:1", {"needs \"value\" or some of"});
  refuses(shape(R"(<rotate x="0" angle="3"/>)"), "3:1", {"the axis is zero"});
  refuses(shape(R"(<rotate x="1"/>)"), "3:1", {"angle"});
  refuses(shape(R"(<scale x="2" value="3"/>)"), "3:1", {"both \"value\" and"});
  refuses(shape(R"(<scale z="q"/>)"), "3:1", {"\"q\" is not a finite number"});
  refuses(shape(R"(<translate value="1 2"/>)"), "3:1", {"is not one or three finite numbers"});
  refuses(shape(R"(<translate w="1"/>)"), "3:1", {"has no attribute \"w\""});
  refuses(shape(R"(<matrix value="1 2 3 4 5 6 7 8 9 10 11 12"/>)"), "3:1", {"needs 16 (or 9)", "not 12"});
  refuses(shape(R"(<matrix value="1 0 0 0 0 1 0 0 0 0 nan 0 0 0 0 1"/>)"), "3:1", {"needs 16 (or 9) finite numbers"});
  refuses(shape(R"(<matrix value="1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 2"/>)"), "3:1", {"last row"});
  refuses(shape(R"(<lookat origin="0 0 0" target="0 0 0" up="0 1 0"/>)"), "3:1", {"do not define a view"});
  refuses(shape(R"(<lookat origin="0 0 0" target="0 1 0" up="0 1 0"/>)"), "3:1", {"do not define a view"});
  refuses(shape(R"(<shear x="1"/>)"), "3:1",
          {"unknown transform operation <shear>", "supported: translate, scale, rotate, matrix, lookat"});
  refuses(shape(R"(<scale x="0"/>)"), "2:20", {"singular"});
}

TEST_F(LoadTest, Colors) {
  const auto diffuse = [this](const std::string& parameter) {
    return color("<bsdf type=\"diffuse\">" + parameter + "</bsdf>");
  };
  EXPECT_EQ(diffuse(R"(<rgb name="reflectance" value="0.5"/>)"), Vec3f(0.5f));
  EXPECT_EQ(diffuse(R"(<rgb name="reflectance" value="0.5 0.6,0.7"/>)"), Vec3f(0.5f, 0.6f, 0.7f));
  EXPECT_EQ(diffuse(R"(<rgb name="reflectance" value=" 0.5 ,0.6 , 0.7 "/>)"), Vec3f(0.5f, 0.6f, 0.7f));
  EXPECT_LT(length(diffuse(R"(<rgb name="reflectance" value="#ff8000"/>)") - Vec3f(1.0f, 0.2158605f, 0.0f)), 1e-6f);
  EXPECT_EQ(diffuse(R"(<spectrum name="reflectance" value="0.3"/>)"), Vec3f(0.3f));
  EXPECT_EQ(diffuse(R"(<float name="reflectance" value="0.3"/>)"), Vec3f(0.3f));
  EXPECT_EQ(diffuse(R"(<spectrum name="reflectance" type="uniform"><float name="value" value="0.2"/></spectrum>)"),
            Vec3f(0.2f));

  const auto bad = [this](const std::string& parameter, std::initializer_list<std::string> parts) {
    refuses("<bsdf type=\"diffuse\">\n" + parameter + "</bsdf>", "3:1", parts);
  };
  bad(R"(<rgb name="reflectance" value="1.5"/>)", {"between 0 and 1", "1.5"});
  bad(R"(<rgb name="reflectance" value="-0.5"/>)", {"between 0 and 1"});
  bad(R"(<rgb name="reflectance" value="0.5 0.5"/>)", {"is not a colour", "supported:"});
  bad(R"(<rgb name="reflectance" value="#12345"/>)", {"is not a colour"});
  bad(R"(<rgb name="reflectance" value="#12345g"/>)", {"#rrggbb"});
  EXPECT_EQ(diffuse(R"(<rgb name="reflectance" value=", 0.5,,0.25, 0.75,"/>)"), Vec3f(0.5f, 0.25f, 0.75f));
  bad(R"(<rgb name="reflectance" value="nan"/>)", {"is not a colour"});
  bad(R"(<rgb name="reflectance" r="0.5"/>)", {"has no attribute \"r\""});
  bad(R"(<rgb name="reflectance"/>)", {"needs the attribute \"value\""});
  bad(R"(<spectrum name="reflectance" filename="a.spd"/>)", {"\"a.spd\" does not exist"});
  bad(R"(<spectrum name="reflectance" type="blackbody"/>)", {"a blackbody spectrum is one of emitters only"});
  bad(R"(<string name="reflectance" value="red"/>)", {"must be <float>, <rgb>, <spectrum> or <texture>, not <string>"});
}

TEST_F(LoadTest, ScatteringModels) {
  Material m = bsdf(R"(<bsdf type="plastic"/>)");
  EXPECT_EQ(m.type, BsdfType::plastic);
  EXPECT_FALSE(m.nonlinear);
  EXPECT_NEAR(m.int_ior / m.ext_ior, 1.4895873f, 1e-6f);
  EXPECT_GE(m.reflectance, 0);
  m = bsdf(R"(<bsdf type="dielectric"/>)");
  EXPECT_NEAR(m.int_ior / m.ext_ior, 1.5041833f, 1e-6f);
  EXPECT_EQ(m.reflectance, -1);
  m = bsdf(
      R"(<bsdf type="thindielectric"><string name="int_ior" value="Water"/><float name="ext_ior" value="1"/><float name="specular_transmittance" value="0.5"/></bsdf>)");
  EXPECT_EQ(m.type, BsdfType::thindielectric);
  EXPECT_EQ(m.int_ior, 1.333f);
  EXPECT_GE(m.specular_transmittance, 0);
  m = bsdf(
      R"(<bsdf type="roughplastic"><string name="distribution" value="GGX"/><float name="alpha" value="0.3"/><boolean name="nonlinear" value="True"/></bsdf>)");
  EXPECT_EQ(m.distribution, MicrofacetDistribution::ggx);
  EXPECT_TRUE(m.nonlinear);
  EXPECT_EQ(m.alpha_u, m.alpha_v);
  m = bsdf(
      R"(<bsdf type="roughconductor"><string name="material" value="Au"/><float name="alpha_u" value="0.1"/><float name="alpha_v" value="0.2"/></bsdf>)");
  EXPECT_NEAR(m.eta.z, 1.442f, 1e-3f);
  EXPECT_NEAR(m.k.x, 3.983f, 1e-3f);
  EXPECT_NE(m.alpha_u, m.alpha_v);
  m = bsdf(R"(<bsdf type="conductor"/>)");
  EXPECT_EQ(m.eta, Vec3f(0.0f));
  EXPECT_EQ(m.k, Vec3f(1.0f));
  m = bsdf(R"(<bsdf type="conductor"><rgb name="eta" value="1 2 3"/><float name="k" value="4"/></bsdf>)");
  EXPECT_EQ(m.eta, Vec3f(1, 2, 3));
  EXPECT_EQ(m.k, Vec3f(4.0f));

  const auto bad = [this](const std::string& type, const std::string& parameter, const std::string& place,
                          std::initializer_list<std::string> parts) {
    refuses("<bsdf type=\"" + type + "\">\n" + parameter + "</bsdf>", place, parts);
  };
  bad("difuse", "", "2:1",
      {"bsdf \"difuse\" is not supported", "did you mean \"diffuse\"", "roughconductor", "bumpmap"});
  bad("diffuse", R"(<float name="reflectanc" value="0.3"/>)", "3:1",
      {"unknown parameter \"reflectanc\" of bsdf \"diffuse\"", "did you mean \"reflectance\"",
       "supported: reflectance"});
  bad("dielectric", R"(<string name="int_ior" value="diamon"/>)", "3:1",
      {"unknown medium \"diamon\"", "did you mean \"diamond\"", "bk7"});
  bad("dielectric", R"(<float name="int_ior" value="-1"/>)", "3:1", {"not an index of refraction"});
  bad("dielectric", R"(<rgb name="int_ior" value="1"/>)", "3:1", {"must be <float> or <string>, not <rgb>"});
  bad("plastic", R"(<float name="int_ior" value="0.9"/>)", "3:1", {"int_ior greater than ext_ior"});
  bad("conductor", R"(<string name="material" value="Gold"/>)", "3:1", {"unknown conductor \"Gold\"", "Au"});
  EXPECT_EQ(
      bsdf(R"(<bsdf type="conductor"><string name="material" value="none"/><rgb name="eta" value="2"/></bsdf>)").eta,
      Vec3f(2.0f));
  bad("conductor", R"(<string name="material" value="Au"/><rgb name="eta" value="2"/>)", "3:1",
      {"either material or eta and k"});
  bad("roughconductor", R"(<float name="alpha_u" value="0.1"/>)", "2:1", {"both alpha_u and alpha_v"});
  bad("roughconductor", R"(<string name="distribution" value="phong"/>)", "3:1",
      {"cannot be \"phong\"", "supported: beckmann, ggx"});
  bad("roughplastic", R"(<texture name="alpha" type="checkerboard"/>)", "3:1", {"give a number, not a texture"});
  bad("roughplastic", R"(<float name="alpha" value="-0.1"/>)", "3:1", {"must be between 0 and 10"});
  bad("roughdielectric", R"(<float name="int_ior" value="1.3"/><float name="ext_ior" value="1.3"/>)", "3:1",
      {"differs from ext_ior", "\"null\""});
  bad("roughdielectric", R"(<float name="alpha" value="0.1"/><float name="alpha_u" value="0.1"/>)", "2:1",
      {"roughdielectric needs both alpha_u and alpha_v"});
  bad("principled", R"(<float name="eta" value="1.3"/><float name="specular" value="0.3"/>)", "3:32",
      {"eta or specular, not both"});
  EXPECT_NO_THROW(bsdf(R"(<bsdf type="principled"><float name="metallic" value="1.000001"/></bsdf>)"));  // a rounding
  bad("principled", R"(<float name="metallic" value="1.3"/>)", "3:1", {"the value must be between 0 and 1", "1.3"});
  bad("principled", R"(<float name="diff_trans" value="1"/>)", "3:1", {"unknown parameter \"diff_trans\""});
  bad("principledthin", R"(<float name="diff_trans" value="2.5"/>)", "3:1", {"between 0 and 2"});
  bad("null", R"(<float name="alpha" value="1"/>)", "3:1", {"unknown parameter \"alpha\""});
  bad("diffuse", R"(<bsdf type="diffuse"/>)", "3:1", {"<bsdf> cannot stand inside bsdf \"diffuse\""});
  bad("diffuse", R"(<float name="reflectance" value="0.5x"/>)", "3:1", {"is not one number"});
  bad("plastic", R"(<boolean name="nonlinear" value="1"/>)", "3:1", {"is not a boolean; supported: true, false"});
  bad("plastic", R"(<float name="nonlinear" value="1"/>)", "3:1", {"must be <boolean>, not <float>"});
  bad("diffuse", R"(<float value="1"/>)", "3:1", {"needs a name"});
  bad("diffuse", R"(<float name="reflectance" value="1"/><float name="reflectance" value="1"/>)", "3:38",
      {"is given twice"});
  bad("diffuse", R"(<scale value="2"/>)", "3:1", {"transform operations stand inside <transform>"});
  bad("diffuse", R"(<flot name="a" value="2"/>)", "3:1", {"unknown element <flot>", "did you mean \"float\""});
  refuses("<bsdf/>", "2:1", {"needs the attribute \"type\""});
  refuses(R"(<bsdf type="diffuse" idd="a"/>)", "2:1", {"no attribute \"idd\"", "did you mean \"id\""});
}

TEST_F(LoadTest, Wrappers) {
  Image image(2, 2, {"R", "G", "B"});
  image.data.assign(12, 0.25f);
  write_exr(folder_.file("t.exr"), image);
  const std::string texture = R"(<texture type="bitmap"><string name="filename" value="t.exr"/></texture>)";
  Material m =
      bsdf(R"(<bsdf type="mask"><float name="opacity" value="0.3"/><bsdf type="twosided"><bsdf type="bumpmap">)" +
           texture + R"(<float name="scale" value="3"/><bsdf type="plastic"/></bsdf></bsdf></bsdf>)");
  EXPECT_EQ(m.type, BsdfType::plastic);
  EXPECT_TRUE(m.two_sided);
  EXPECT_GE(m.opacity, 0);
  EXPECT_GE(m.bump, 0);
  EXPECT_EQ(m.bump_scale, 3.0f);
  m = bsdf(R"(<bsdf type="bumpmap">)" + texture + R"(<bsdf type="twosided"><bsdf type="diffuse"/></bsdf></bsdf>)");
  EXPECT_TRUE(m.two_sided);
  EXPECT_GE(m.bump, 0);
  Scene scene = load(R"(<bsdf type="twosided" id="t"><bsdf type="diffuse"/><bsdf type="plastic"/></bsdf>)");
  m = scene.materials.back();
  EXPECT_EQ(m.id, "t");
  EXPECT_EQ(scene.materials.at(static_cast<std::size_t>(m.back)).type, BsdfType::plastic);
  // A mask around it is one of both sides.
  scene = load(
      R"(<bsdf type="mask" id="m"><float name="opacity" value="0.3"/><bsdf type="twosided" id="t"><bsdf type="diffuse"/><bsdf type="plastic"/></bsdf></bsdf><shape type="cube"><ref id="t"/></shape>)");
  const auto named_material = [&](const std::string& id) {
    return *std::find_if(scene.materials.begin(), scene.materials.end(), [&](const Material& x) { return x.id == id; });
  };
  m = named_material("m");
  EXPECT_GE(m.opacity, 0);
  EXPECT_EQ(scene.materials.at(static_cast<std::size_t>(m.back)).opacity, m.opacity);
  EXPECT_LT(scene.materials.at(static_cast<std::size_t>(named_material("t").back)).opacity, 0);
  // A mask without opacity is half transparent; a colour counts by the mean of its channels.
  scene = load(R"(<bsdf type="mask"><bsdf type="diffuse"/></bsdf>)");
  EXPECT_EQ(
      evaluate_texture(texture_view(scene.textures[static_cast<std::size_t>(scene.materials.back().opacity)]), {0, 0})
          .x,
      0.5f);
  scene = load(R"(<bsdf type="mask"><rgb name="opacity" value="1 0 0"/><bsdf type="diffuse"/></bsdf>)");
  EXPECT_NEAR(
      evaluate_texture(texture_view(scene.textures[static_cast<std::size_t>(scene.materials.back().opacity)]), {0, 0})
          .x,
      1.0f / 3.0f, 1e-6f);

  // A normal map is a colour, a bump map is not; both know on which side of twosided they stand.
  const std::string named =
      R"(<texture name="normalmap" type="bitmap"><string name="filename" value="t.exr"/></texture>)";
  m = bsdf(R"(<bsdf type="twosided"><bsdf type="normalmap">)" + named +
           R"(<boolean name="flip_invalid_normals" value="false"/><bsdf type="plastic"/></bsdf></bsdf>)");
  EXPECT_TRUE(m.two_sided && m.normal_map && m.bump_mirrored && !m.bump_flips && m.bump_shadows);
  m = bsdf(R"(<bsdf type="normalmap">)" + named + R"(<bsdf type="twosided"><bsdf type="diffuse"/></bsdf></bsdf>)");
  EXPECT_TRUE(m.normal_map && m.two_sided && !m.bump_mirrored);
  // The second of two sides stands inside as well; where else it is used, it does not.
  scene = load(
      R"(<bsdf type="normalmap" id="n">)" + named + R"(<bsdf type="diffuse"/></bsdf>)" +
      R"(<bsdf type="twosided" id="t"><bsdf type="diffuse"/><ref id="n"/></bsdf><shape type="cube"><ref id="n"/></shape>)");
  m = scene.materials.at(static_cast<std::size_t>(named_material("t").back));
  EXPECT_TRUE(m.normal_map && m.bump_mirrored);
  EXPECT_FALSE(named_material("n").bump_mirrored);

  const std::string red = R"(<bsdf type="diffuse"><rgb name="reflectance" value="1 0 0"/></bsdf>)";
  const auto blend = [](const std::string& inside) {
    return R"(<bsdf type="blendbsdf"><float name="weight" value="0.25"/>)" + inside + "</bsdf>";
  };
  scene = load(blend(red + R"(<bsdf type="principled"><float name="spec_trans" value="0"/></bsdf>)"));
  m = scene.materials.back();
  EXPECT_EQ(m.type, BsdfType::blendbsdf);
  EXPECT_EQ(scene.materials.at(static_cast<std::size_t>(m.blended[0])).type, BsdfType::diffuse);
  const Material& disney = scene.materials.at(static_cast<std::size_t>(m.blended[1]));
  EXPECT_EQ(disney.type, BsdfType::principled);
  EXPECT_EQ(disney.extra[ExtraParameter::spec_trans], -1);  // as if it were not given
  EXPECT_NEAR(disney.int_ior, 1.5f, 1e-6f);                 // specular 0.5
  EXPECT_FALSE(m.two_sided);
  EXPECT_TRUE(
      bsdf(blend(R"(<bsdf type="twosided"><bsdf type="diffuse"/></bsdf><bsdf type="twosided">)" + red + "</bsdf>"))
          .two_sided);
  EXPECT_TRUE(bsdf(R"(<bsdf type="twosided">)" + blend(red + red) + "</bsdf>").two_sided);
  // Of one that is two-sided itself, the front is seen from both sides.
  const std::string both_sides = R"(<bsdf type="twosided">)" + red + red + "</bsdf>";
  EXPECT_GE(bsdf(both_sides).back, 0);
  EXPECT_EQ(bsdf(R"(<bsdf type="twosided">)" + both_sides + "</bsdf>").back, -1);
  refuses(R"(<bsdf type="twosided">)" + blend(red + R"(<bsdf type="roughdielectric"/>)") + "</bsdf>", "2:23",
          {"lets light through"});
  refuses(R"(<bsdf type="twosided"><bsdf type="principled"><float name="spec_trans" value="0.1"/></bsdf></bsdf>)",
          "2:23", {"lets light through"});
  refuses(R"(<bsdf type="blendbsdf"><bsdf type="diffuse"/><bsdf type="diffuse"/></bsdf>)", "2:1", {"needs a weight"});
  refuses(blend(red), "2:1", {"needs two nested bsdfs"});
  refuses(blend(red + red + red), "2:193", {"at most 2"});
  refuses(blend(red + R"(<bsdf type="bumpmap">)" + texture + red + "</bsdf>"), "2:126",
          {"a bumpmap inside a blendbsdf is not supported"});
  std::string deep = red;
  for (int i = 0; i < kMostBlended - 1; ++i) deep = blend(red + deep);
  EXPECT_EQ(bsdf(deep).type, BsdfType::blendbsdf);
  refuses(blend(red + deep), "2:1", {"at most 8 bsdfs", "this one 9"});
  // Backs count: seen from behind they take the places of their fronts.
  const auto two = [](const std::string& sides) { return "<bsdf type=\"twosided\">" + sides + "</bsdf>"; };
  std::string five = red;
  for (int i = 0; i < 4; ++i) five = blend(red + five);
  EXPECT_EQ(bsdf(blend(red + two(red + five))).type, BsdfType::blendbsdf);
  refuses(blend(two(red + five) + two(red + five)), "2:1", {"at most 8 bsdfs", "this one 10"});
  refuses(blend(red + two(red + R"(<bsdf type="bumpmap">)" + texture + red + "</bsdf>")), "2:126",
          {"a bumpmap inside a blendbsdf is not supported"});
  refuses(R"(<bsdf type="normalmap"><bsdf type="diffuse"/></bsdf>)", "2:1", {"name=\"normalmap\""});
  refuses(R"(<bsdf type="normalmap">)" + named + R"(<bsdf type="bumpmap">)" + texture + red + "</bsdf></bsdf>", "2:1",
          {"a bumpmap or normalmap inside another"});

  refuses(R"(<bsdf type="twosided"/>)", "2:1", {"needs a nested <bsdf>"});
  refuses(R"(<bsdf type="twosided"><bsdf type="dielectric"/></bsdf>)", "2:23", {"lets light through"});
  refuses(R"(<bsdf type="twosided"><bsdf type="mask"><bsdf type="diffuse"/></bsdf></bsdf>)", "2:23",
          {"put the mask around"});
  refuses(R"(<bsdf type="twosided"><bsdf type="diffuse"/><bsdf type="dielectric"/></bsdf>)", "2:45",
          {"lets light through"});
  refuses(R"(<bsdf type="twosided"><bsdf type="diffuse"/><bsdf type="diffuse"/><bsdf type="diffuse"/></bsdf>)", "2:67",
          {"at most 2"});
  refuses(R"(<bsdf type="bumpmap"><bsdf type="diffuse"/></bsdf>)", "2:1", {"exactly one <texture>"});
  refuses(R"(<bsdf type="bumpmap"><texture type="checkerboard"/><bsdf type="diffuse"/></bsdf>)", "2:22",
          {"a texture with a gradient"});
  refuses(R"(<bsdf type="mask"><float name="opacity" value="2"/><bsdf type="diffuse"/></bsdf>)", "2:19",
          {"an opacity must be between 0 and 1"});
}

TEST_F(LoadTest, References) {
  // Named and unnamed, forwards, to inner objects.
  const Scene scene =
      load(R"(<shape type="sphere"><ref id="inner"/></shape><shape type="sphere"><ref name="bsdf" id="outer"/></shape>
    <bsdf type="twosided" id="outer"><bsdf type="diffuse" id="inner"><ref name="reflectance" id="t"/></bsdf></bsdf><texture type="checkerboard" id="t"/>)");
  const Material &inner = scene.materials[static_cast<std::size_t>(scene.shapes[0].material)],
                 &outer = scene.materials[static_cast<std::size_t>(scene.shapes[1].material)];
  EXPECT_EQ(inner.id, "inner");
  EXPECT_FALSE(inner.two_sided);
  EXPECT_TRUE(outer.two_sided);
  EXPECT_EQ(inner.reflectance, outer.reflectance);

  refuses(R"(<bsdf type="diffuse" id="Wood"/><shape type="sphere"><ref id="Wod"/></shape>)", "2:54",
          {"nothing has the id \"Wod\"", "did you mean \"Wood\""});
  refuses(R"(<bsdf type="twosided" id="a"><ref id="b"/></bsdf><bsdf type="twosided" id="b"><ref id="a"/></bsdf>)",
          "2:1", {"contains itself"});
  refuses("<bsdf type=\"diffuse\" id=\"a\"/>\n<bsdf type=\"diffuse\" id=\"a\"/>", "3:1",
          {"the id \"a\" is taken already", "s.xml:2:1"});
  refuses(R"(<bsdf type="diffuse" id="a"><ref name="reflectance" id="a"/></bsdf>)", "2:29",
          {"must be <float>, <rgb>, <spectrum> or <texture>, not <bsdf>"});
  refuses(R"(<shape type="sphere"><ref/></shape>)", "2:22", {"needs the attribute \"id\""});
  refuses(R"(<texture type="checkerboard" id="t"/><shape type="sphere"><ref id="t"/></shape>)", "2:59",
          {"<texture> cannot stand inside shape \"sphere\""});
}

TEST_F(LoadTest, Textures) {
  const auto bad = [this](const std::string& texture, const std::string& place,
                          std::initializer_list<std::string> parts) {
    refuses("<bsdf type=\"diffuse\"><texture name=\"reflectance\"\n " + texture + "</texture></bsdf>", place, parts);
  };
  bad(R"(type="bitmap">)", "2:22", {"needs the parameter <string name=\"filename\""});
  bad("type=\"bitmap\">\n<string name=\"filename\" value=\"none.png\"/>", "4:1",
      {"file \"none.png\" does not exist (looked for"});
  bad(R"(type="bitmpa">)", "2:22", {"texture \"bitmpa\" is not supported", "did you mean \"bitmap\""});
  bad("type=\"checkerboard\">\n<texture name=\"color0\" type=\"checkerboard\"/>", "4:1", {"must be a constant"});
  bad("type=\"checkerboard\">\n<rgb name=\"color2\" value=\"1\"/>", "4:1", {"did you mean \"color"});
  // What one use allows another may not.
  refuses(
      "<texture type=\"checkerboard\" id=\"t\"><rgb name=\"color0\" value=\"5\"/></texture><shape type=\"sphere\">"
      "<emitter type=\"area\"><ref name=\"radiance\" id=\"t\"/></emitter></shape>\n<bsdf type=\"diffuse\">"
      "<ref name=\"reflectance\" id=\"t\"/></bsdf>",
      "2:37", {"reflectance", "not 5"});
  folder_.write("t.png", "x");
  bad("type=\"bitmap\"><string name=\"filename\" value=\"t.png\"/>\n<string name=\"wrap_mode\" value=\"repat\"/>",
      "4:1", {"did you mean \"repeat\"", "supported: repeat, mirror, clamp"});
  bad("type=\"bitmap\">\n<string name=\"filename\" value=\"t.png\"/>", "4:1", {"t.png"});
}

TEST_F(LoadTest, Emitters) {
  Scene scene = load_whole(
      kSensor + R"(<shape type="cube"><emitter type="area"><rgb name="radiance" value="3 20 100"/></emitter></shape>
    <shape type="sphere"><bsdf type="diffuse"/><emitter type="area"><spectrum name="radiance" value="3"/></emitter></shape><emitter type="constant"><float name="radiance" value="2"/></emitter>)");
  ASSERT_EQ(scene.area_lights.size(), 2u);
  EXPECT_EQ(scene.shapes[0].emitter, 0);
  EXPECT_EQ(scene.area_lights[1].shape, 1);
  EXPECT_EQ(
      evaluate_texture(texture_view(scene.textures[static_cast<std::size_t>(scene.area_lights[0].radiance)]), {0, 0}),
      Vec3f(3, 20, 100));
  EXPECT_LT(length(evaluate_texture(
                       texture_view(scene.textures[static_cast<std::size_t>(scene.area_lights[1].radiance)]), {0, 0}) -
                   Vec3f(3.61438f, 2.84487f, 2.72675f)),
            2e-5f);  // Mitsuba's
  // A light without a bsdf is black.
  EXPECT_EQ(evaluate_texture(texture_view(scene.textures[static_cast<std::size_t>(
                                 scene.materials[static_cast<std::size_t>(scene.shapes[0].material)].reflectance)]),
                             {0, 0}),
            Vec3f(0.0f));
  ASSERT_EQ(scene.environments.size(), 1u);
  EXPECT_EQ(scene.environments[0].pixels, (std::vector<Vec3f>{Vec3f(2.0f)}));

  Image image(2, 1, {"R", "G", "B"});
  image.data = {1, 2, 3, 4, 5, 6};
  write_exr(folder_.file("e.exr"), image);
  scene = load(R"(<emitter type="envmap"><string name="filename" value="e.exr"/><float name="scale" value="2"/>
    <transform name="to_world"><scale value="3"/><rotate y="1" angle="90"/></transform></emitter>)");
  EXPECT_EQ(scene.environments[0].width, 2);
  EXPECT_EQ(scene.environments[0].pixels[1], Vec3f(8, 10, 12));
  EXPECT_NEAR(scene.environments[0].to_world[2], 1.0f, 1e-6f);  // +z goes to +x

  scene = load(R"(<emitter type="point"/><emitter type="spot"><float name="cutoff_angle" value="30"/></emitter>)");
  ASSERT_EQ(scene.delta_lights.size(), 2u);
  EXPECT_EQ(scene.delta_lights[0].intensity, Vec3f(1.0f));
  EXPECT_NEAR(scene.delta_lights[1].cos_cutoff, std::cos(kPi / 6.0f), 1e-6f);
  EXPECT_TRUE(scene.sampling_weights().empty());
  scene = load(
      R"(<emitter type="point"/><emitter type="spot"><float name="sampling_weight" value="0"/></emitter><emitter type="constant"><float name="sampling_weight" value="3"/></emitter><shape type="sphere"><emitter type="area"><float name="sampling_weight" value="2.5"/></emitter></shape>)");
  EXPECT_EQ(scene.sampling_weights(), (std::vector<float>{2.5f, 1.0f, 0.0f, 3.0f}));
  refuses(R"(<emitter type="point"><float name="sampling_weight" value="-1"/></emitter>)", "2:23",
          {"must be between 0 and 1e+06"});
  refuses(R"(<emitter type="point"><float name="sampling_wait" value="2"/></emitter>)", "2:23",
          {"did you mean \"sampling_weight\"?"});
  refuses(R"(<emitter type="point"><float name="sampling_weight" value="0"/></emitter>)", "1:1",
          {"sampling_weight of all emitters is 0"});
  refuses(R"(<emitter type="pointy"/>)", "2:1",
          {"emitter \"pointy\" is not supported (did you mean \"point\"?)",
           "supported: point, spot, directional, projector, envmap, constant, and area inside a shape"});
  for (const char* sky : {"sky", "sun", "sunsky"})
    refuses("<emitter type=\"" + std::string(sky) + "\"/>", "2:1", {"is not supported: bake it", "envmap"});
  refuses(R"(<emitter type="directionalarea"/>)", "2:1", {"\"directionalarea\" is not supported", "directional"});
  refuses(R"(<emitter type="directional"><vector name="direction" x="0" y="0" z="0"/></emitter>)", "2:29",
          {"must not be zero"});
  refuses(R"(<emitter type="point"><rgb name="intensity" value="-1"/></emitter>)", "2:23", {"radiance must be"});
  refuses(R"(<emitter type="point"><point name="position" x="1e10" y="0" z="0"/></emitter>)", "2:1", {"too far away"});
  refuses(R"(<emitter type="projector"><float name="fov" value="200"/></emitter>)", "2:27", {"below 180"});
  refuses(R"(<emitter type="area"/>)", "2:1", {"must stand inside a shape"});
  refuses(R"(<emitter type="constant"/><emitter type="constant"/>)", "2:27", {"second environment"});
  refuses(R"(<emitter type="envmap"/>)", "2:1", {"filename"});
  refuses(
      R"(<emitter type="envmap"><string name="filename" value="e.exr"/><transform name="to_world"><scale x="0"/></transform></emitter>)",
      "2:63", {"is singular"});
  refuses(R"(<shape type="sphere"><emitter type="point"/></shape>)", "2:22",
          {"cannot stand inside a shape; supported: area"});
  refuses(R"(<shape type="sphere"><emitter type="area"/><emitter type="area"/></shape>)", "2:44",
          {"at most one emitter"});
  refuses(R"(<shape type="sphere"><emitter type="area"><rgb name="radiance" value="-1"/></emitter></shape>)", "2:43",
          {"must be finite and not negative"});
  image.data[0] = -1.0f;
  write_exr(folder_.file("negative.exr"), image);
  const Scene clamped = load(R"(<emitter type="envmap"><string name="filename" value="negative.exr"/></emitter>)");
  EXPECT_EQ(clamped.environments.at(0).pixels[0].x, 0.0f);
  EXPECT_NE(join(clamped.assumed).find("has 1 negative values, read as 0"), std::string::npos);
}

TEST_F(LoadTest, Shapes) {
  const Scene scene = load_whole(
      kSensor + R"(<shape type="sphere"><point name="center" x="1" y="0" z="0"/><float name="radius" value="0.8"/>
      <transform name="to_world"><scale value="2"/><rotate z="1" angle="90"/></transform></shape>
    <shape type="sphere"><transform name="to_world"><scale x="-1"/></transform></shape>
    <shape type="rectangle" id="r"><boolean name="flip_normals" value="true"/></shape>)");
  EXPECT_LT(length(scene.spheres[0].center - Vec3f(0, 2, 0)), 1e-6f);
  EXPECT_FLOAT_EQ(scene.spheres[0].radius, 1.6f);
  EXPECT_FALSE(scene.spheres[0].flip_normals);
  EXPECT_TRUE(scene.spheres[1].flip_normals);
  EXPECT_EQ(scene.shapes[2].id, "r");
  EXPECT_TRUE(scene.meshes[0].flip_normals);
  EXPECT_EQ(scene.triangle_count(), 2u);
  // Mitsuba's rectangle is no mesh: what mirrors it does not turn it round.
  const std::string mirrored = R"(<transform name="to_world"><scale x="-1"/></transform></shape>)";
  EXPECT_EQ(load(R"(<shape type="rectangle"><boolean name="face_normals" value="true"/>)" + mirrored).fingerprint,
            load(R"(<shape type="rectangle">)" + mirrored).fingerprint);

  refuses(R"(<shape type="hair"/>)", "2:1",
          {"shape \"hair\" is not supported",
           "supported: obj, ply, serialized, rectangle, cube, disk, sphere, cylinder, linearcurve"});
  refuses(R"(<shape type="cylinder"><float name="radius" value="-1"/></shape>)", "2:24", {"must be above 0"});
  refuses(R"(<shape type="sphere"><float name="radiu" value="3"/></shape>)", "2:22", {"did you mean \"radius\""});
  refuses(R"(<shape type="sphere"><float name="radius" value="0"/></shape>)", "2:22", {"above 0"});
  refuses(R"(<shape type="sphere"><string name="radius" value="3"/></shape>)", "2:22",
          {"must be <float> or <integer>, not <string>"});
  refuses(R"(<shape type="sphere"><transform name="to_world"><matrix value="1 1 0 0 1 0 0 0 1"/></transform></shape>)",
          "2:22", {"scale all axes alike"});
  refuses(R"(<shape type="sphere"><bsdf type="diffuse"/><bsdf type="diffuse"/></shape>)", "2:44", {"at most one bsdf"});
  refuses(R"(<shape type="obj"/>)", "2:1", {"filename"});
  refuses(R"(<shape type="obj"><string name="filename" value="none.obj"/></shape>)", "2:19",
          {"\"none.obj\" does not exist"});
  EXPECT_TRUE(
      load(R"(<shape type="cube"><boolean name="face_normals" value="true"/></shape>)").meshes[0].normals.empty());
  refuses(R"(<shape type="disk"><boolean name="face_normals" value="true"/></shape>)", "2:20",
          {"unknown parameter \"face_normals\""});
  refuses(R"(<shape type="sphere"><medium name="interior" type="homogeneous"/></shape>)", "2:22",
          {"<medium> inside shape \"sphere\" is not supported"});
  folder_.write("bad.obj", "v 0 0 0\nf 1 2 3\n");
  refuses(R"(<shape type="obj"><string name="filename" value="bad.obj"/></shape>)", "2:19",
          {"bad.obj:2:5: face: there is no vertex 2"});
}

TEST_F(LoadTest, SensorsAndFilms) {
  const Scene scene = load_whole(
      R"(<integrator type="path"><integer name="max_depth" value="7"/><integer name="rr_depth" value="3"/></integrator>
    <sensor type="perspective"><float name="fov" value="30"/><string name="fov_axis" value="smaller"/><float name="near_clip" value="0.5"/><float name="far_clip" value="50"/>
      <float name="focus_distance" value="3"/><float name="principal_point_offset_x" value="0.1"/>
      <transform name="to_world"><lookat origin="1 2 3" target="0 0 1" up="0 1 0"/></transform><sampler type="independent"><integer name="sample_count" value="3"/></sampler>
      <film type="hdrfilm"><integer name="width" value="320"/><integer name="height" value="200"/><rfilter type="tent"><float name="radius" value="2"/></rfilter></film></sensor>
    <sensor type="perspective"><film type="hdrfilm"><integer name="width" value="64"/><rfilter type="box"/></film></sensor>)" +
      kSphere);
  EXPECT_EQ(scene.max_depth, 7);
  ASSERT_EQ(scene.cameras.size(), 2u);
  const Camera& c = scene.cameras[0];
  const Camera expected = look_at({1, 2, 3}, {0, 0, 1}, {0, 1, 0}, 30.0f, Camera::FovAxis::smaller);
  EXPECT_EQ(c.forward, expected.forward);
  EXPECT_EQ(c.right, expected.right);
  EXPECT_EQ(c.fov_axis, Camera::FovAxis::smaller);
  EXPECT_EQ(c.near_clip, 0.5f);
  EXPECT_EQ(c.principal_point_offset.x, 0.1f);
  EXPECT_EQ(c.film_width, 320);
  EXPECT_EQ(scene.film.filter, Film::Filter::tent);
  EXPECT_EQ(scene.film.filter_radius, 2.0f);
  EXPECT_EQ(scene.cameras[1].film_width, 64);
  ASSERT_EQ(scene.films.size(), 2u);
  EXPECT_EQ(scene.film_of(0).filter, Film::Filter::tent);
  EXPECT_EQ(scene.film_of(1).filter, Film::Filter::box);
  // No fov: 50 mm on 35 mm film.
  EXPECT_EQ(scene.cameras[1].fov_axis, Camera::FovAxis::diagonal);
  EXPECT_NEAR(scene.cameras[1].fov_degrees, 46.7930f, 1e-3f);

  const auto sensor = [](const std::string& body) { return "<sensor type=\"perspective\">\n" + body + "</sensor>"; };
  const auto film = [&](const std::string& body) { return sensor("<film type=\"hdrfilm\">" + body + "</film>"); };
  refuses(
      R"(<sensor type="thinlense"/>)", "2:1",
      {"sensor \"thinlense\" is not supported (did you mean \"thinlens\"?); supported: perspective, thinlens, orthographic"});
  refuses(R"(<sensor type="thinlens"/>)", "2:1", {"needs an aperture_radius"});
  refuses(R"(<sensor type="thinlens"><float name="aperture_radius" value="-1"/></sensor>)", "2:25", {"not below 0"});
  refuses(R"(<sensor type="orthographic"><float name="fov" value="60"/></sensor>)", "2:29",
          {"unknown parameter \"fov\""});
  refuses(sensor(R"(<float name="fov" value="180"/>)"), "3:1", {"below 180"});
  refuses(sensor(R"(<float name="fov" value="60"/><string name="fov_axis" value="z"/>)"), "3:31",
          {"supported: x, y, diagonal, smaller, larger"});
  refuses(sensor(R"(<float name="near_clip" value="0"/>)"), "3:1", {"near_clip must be above 0"});
  refuses(sensor(R"(<transform name="to_world"><scale value="2"/></transform>)"), "3:1", {"must not scale"});
  refuses(sensor(R"(<string name="focal_length" value="wide"/>)"), "3:1", {"is not a length"});
  refuses(film(R"(<integer name="width" value="0"/>)"), "3:22", {"must be between 1 and 131072"});
  refuses(film(R"(<integer name="width" value="1.5"/>)"), "3:22", {"is not a 32-bit integer"});
  refuses(film(R"(<float name="width" value="100"/>)"), "3:22", {"must be <integer>, not <float>"});
  refuses(film(R"(<rfilter type="michell"/>)"), "3:22",
          {"rfilter \"michell\" is not supported", "supported: box, tent, gaussian, mitchell, catmullrom, lanczos"});
  refuses(film(R"(<rfilter type="lanczos"><integer name="lobes" value="9"/></rfilter>)"), "3:46", {"between 1 and 8"});
  refuses(film(R"(<rfilter type="box"><float name="radius" value="2"/></rfilter>)"), "3:42",
          {"unknown parameter \"radius\""});
  refuses(film(R"(<integer name="crop_width" value="769"/>)"), "3:1", {"reaches beyond the film of 768 x 576"});
  refuses(R"(<integrator type="path"><integer name="max_depth" value="-2"/></integrator>)", "2:25",
          {"must be between -1"});
  refuses(R"(<integrator type="path"/><integrator type="path"/>)", "2:26", {"second integrator"});
}

TEST_F(LoadTest, SensorIsAddedWhereThereIsNone) {
  const std::string shapes =
      R"(<shape type="sphere"><point name="center" x="3" y="-2" z="50"/><float name="radius" value="4"/></shape>)";
  const Scene scene = load_scene(folder_.write("s.xml", scene_text(shapes)));
  ASSERT_EQ(scene.cameras.size(), 1u);
  EXPECT_NE(join(scene.assumed)
                .find("the scene has no sensor: one that looks at all of it from outside, with y up, is added"),
            std::string::npos);
  // It looks at the middle of the box of the sphere, whose corners are within the height of the picture.
  const Camera& camera = scene.cameras[0];
  const Vec3f to_center = Vec3f(3, -2, 50) - camera.origin;
  EXPECT_NEAR(dot(normalize(to_center), camera.forward), 1.0f, 1e-5f);
  EXPECT_NEAR(std::asin(4.0f * std::sqrt(3.0f) / length(to_center)) * 360.0f / 3.14159265f, camera.fov_degrees, 1e-3f);
  EXPECT_GT(camera.up.y, 0.5f);
  // One that cannot be used is replaced where that is asked for.
  LoadOptions options;
  options.permissive = true;
  EXPECT_EQ(load_scene(folder_.write("s.xml", scene_text(shapes + R"(<sensor type="radiancemeter"/>)")), options)
                .cameras[0]
                .origin,
            camera.origin);
  EXPECT_NE(error_whole(scene_text(shapes + R"(<sensor type="radiancemeter"/>)")).find("radiancemeter"),
            std::string::npos);
}

TEST_F(LoadTest, SceneWithoutShapes) {
  const Scene scene = load_whole(kSensor + "<emitter type=\"constant\"/>");
  EXPECT_TRUE(scene.shapes.empty());
  EXPECT_NE(join(scene.warnings).find("no shape"), std::string::npos);
}

TEST_F(LoadTest, WholeFiles) {
  EXPECT_NE(error_whole(scene_text("")).find("s.xml:1:1: the scene has neither a shape with triangles nor a sensor"),
            std::string::npos);
  EXPECT_NE(error_whole("").find("s.xml:1:1: "), std::string::npos);
  EXPECT_NE(error_whole("<scene/>").find("no version attribute"), std::string::npos);
  EXPECT_NE(error_whole("<scene version=\"4.0.0\"/>").find("version \"4.0.0\" is not supported"), std::string::npos);
  EXPECT_NE(error_whole("<bsdf type=\"diffuse\"/>").find("expected <scene>"), std::string::npos);
  EXPECT_NE(error_whole("<scene version=\"3.0.0\">\n<shape type=\"cube\">\n</scene>").find("s.xml:3:"),
            std::string::npos);
  refuses("<shap type=\"cube\"/>", "2:1", {"unknown element <shap>", "did you mean \"shape\""});
  refuses("<camera type=\"perspective\"/>", "2:1", {"unknown element <camera>", "now called <sensor>"});
  EXPECT_THROW(load_scene(folder_.file("none.xml")), IoError);
  EXPECT_THROW(load_scene(folder_.file("")), IoError);
}

TEST_F(LoadTest, FingerprintCoversWhatIsSeenAndNothingElse) {
  const std::string bsdf = R"(<bsdf type="diffuse" id="m"><rgb name="reflectance" value="0.1 0.2 0.3"/></bsdf>)";
  const std::string base = load(bsdf + R"(<shape type="cube"><ref id="m"/></shape>)").fingerprint;
  EXPECT_EQ(load(bsdf + R"(<shape type="cube"><ref id="m"/></shape>)").fingerprint, base);
  EXPECT_EQ(
      load(bsdf + R"(<shape type="cube" id="named"><ref id="m"/></shape><sensor type="perspective"/>)").fingerprint,
      base);
  EXPECT_NE(load(bsdf + R"(<shape type="cube"/>)").fingerprint, base);
  EXPECT_NE(
      load(bsdf + R"(<shape type="cube"><ref id="m"/><boolean name="flip_normals" value="true"/></shape>)").fingerprint,
      base);
  EXPECT_NE(load(bsdf + R"(<shape type="cube"><ref id="m"/><emitter type="area"/></shape>)").fingerprint, base);
  EXPECT_NE(load(bsdf + R"(<shape type="cube"><ref id="m"/></shape><emitter type="constant"/>)").fingerprint, base);
  EXPECT_NE(
      load(
          R"(<bsdf type="diffuse" id="m"><rgb name="reflectance" value="0.1 0.2 0.30001"/></bsdf><shape type="cube"><ref id="m"/></shape>)")
          .fingerprint,
      base);
  EXPECT_NE(
      load(bsdf +
           R"(<shape type="cube"><ref id="m"/><transform name="to_world"><translate x="0.00001"/></transform></shape>)")
          .fingerprint,
      base);
}

}  // namespace
}  // namespace octrad
