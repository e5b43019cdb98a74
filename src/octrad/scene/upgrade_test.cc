// Files of Mitsuba 0.5 and 0.6 in the terms of Mitsuba 3.
#include "octrad/scene/upgrade.h"

#include <gtest/gtest.h>

#include "octrad/base/error.h"
#include "octrad/base/folder_test_helper.h"
#include "octrad/base/join.h"
#include "octrad/image/tonemap_math.h"
#include "octrad/scene/files_test_helper.h"
#include "octrad/scene/load.h"

namespace octrad {
namespace {

const std::string kOldSensor = "<sensor type=\"perspective\"/>\n";
const std::string kOldSphere = "<shape type=\"sphere\"/>\n";

class UpgradeTest : public ::testing::Test {
 protected:
  Scene load(const std::string& body, const std::string& version) const {
    return load_scene(folder_.write(
        "s.xml", "<scene version=\"" + version + "\">\n" + body + kOldSensor + kOldSphere + "</scene>\n"));
  }
  // Both files are the same scene.
  void same(const std::string& old, const std::string& now, const std::string& version = "3.0.0") const {
    EXPECT_EQ(load(old, "0.6.0").fingerprint, load(now, version).fingerprint) << old;
    EXPECT_EQ(load(old, "0.5.0").fingerprint, load(now, version).fingerprint) << old;
  }
  void assumes(const std::string& old, const std::string& text) const {
    const std::string all = join(load(old, "0.6.0").assumed, "\n");
    EXPECT_NE(all.find(text), std::string::npos) << all;
  }
  TestFolder folder_;
};

TEST(SnakeCase, AsMitsuba) {
  EXPECT_EQ(snake_case("toWorld"), "to_world");
  EXPECT_EQ(snake_case("intIOR"), "int_ior");
  EXPECT_EQ(snake_case("diffuseReflectance"), "diffuse_reflectance");
  EXPECT_EQ(snake_case("kNN"), "k_nn");
  EXPECT_EQ(snake_case("fov"), "fov");
  EXPECT_EQ(snake_case("alreadyUsed_here"), "already_used_here");
}

TEST_F(UpgradeTest, Names) {
  same(
      R"(<bsdf type="plastic" id="a"><float name="intIOR" value="1.7"/><float name="extIOR" value="1.1"/><rgb name="diffuseReflectance" value="0.1 0.2 0.3"/></bsdf>)",
      R"(<bsdf type="plastic" id="a"><float name="int_ior" value="1.7"/><float name="ext_ior" value="1.1"/><rgb name="diffuse_reflectance" value="0.1 0.2 0.3"/></bsdf>)");
  same(R"(<bsdf type="diffuse"><rgb name="diffuseReflectance" value="0.1 0.2 0.3"/></bsdf>)",
       R"(<bsdf type="diffuse"><rgb name="reflectance" value="0.1 0.2 0.3"/></bsdf>)");
  same(
      R"(<shape type="cube"><transform name="toWorld"><lookAt origin="1 2 3" target="0 0 0" up="0 1 0"/></transform><boolean name="flipNormals" value="true"/></shape>)",
      R"(<shape type="cube"><transform name="to_world"><lookat origin="1 2 3" target="0 0 0" up="0 1 0"/></transform><boolean name="flip_normals" value="true"/></shape>)");
  const Scene scene = load(R"(<integrator type="sppm"><integer name="maxDepth" value="6"/></integrator>
<sensor type="perspective"><film type="ldrfilm"><integer name="width" value="99"/><float name="gamma" value="2.2"/><boolean name="highQualityEdges" value="true"/></film></sensor>)",
                           "0.6.0");
  EXPECT_EQ(scene.max_depth, 6);
  EXPECT_EQ(scene.film.width, 99);
  EXPECT_NE(join(scene.assumed).find("film \"ldrfilm\" read as hdrfilm"), std::string::npos);
  // A version of its own for every file, and no change in new ones.
  folder_.write("old.xml",
                R"(<scene version="0.5.0"><bsdf type="plastic"><float name="intIOR" value="1.7"/></bsdf></scene>)");
  EXPECT_NO_THROW(load("<include filename=\"old.xml\"/>", "3.0.0"));
  EXPECT_THROW(load(R"(<bsdf type="plastic"><float name="intIOR" value="1.7"/></bsdf>)", "3.0.0"), InputError);
  EXPECT_THROW(
      load(R"(<include filename="old.xml"/><bsdf type="plastic"><float name="intIOR" value="1.7"/></bsdf>)", "3.0.0"),
      InputError);
  EXPECT_THROW(load("", "4.0.0"), InputError);
}

// As Mitsuba 0.6; Mitsuba 3 refuses them.
TEST_F(UpgradeTest, UnusedParameters) {
  const std::string mirror =
      R"(<bsdf type="conductor"><float name="alpha" value="0.1"/><string name="own" value="x"/></bsdf>)";
  same(mirror, R"(<bsdf type="conductor"/>)");
  assumes(mirror, "parameter \"own\" of bsdf \"conductor\" is not used");
  assumes(R"(<bsdf type="plastic"><float name="intIORs" value="1"/></bsdf>)", "did you mean \"int_ior\"?");
  assumes(R"(<integer name="maxDepth" value="10"/>)", "parameter \"maxDepth\" of the scene is not used");
  EXPECT_THROW(load(R"(<integer name="maxDepth" value="10"/>)", "3.0.0"), InputError);
  EXPECT_THROW(load(mirror, "3.0.0"), InputError);
  EXPECT_THROW(load(R"(<bsdf type="diffuse"><bsdf type="diffuse"/></bsdf>)", "0.6.0"), InputError);
}

TEST_F(UpgradeTest, WordsInAnyCase) {
  same(
      R"(<bsdf type="roughconductor"><string name="distribution" value="GGX"/><float name="alpha" value="0.2"/></bsdf>)",
      R"(<bsdf type="roughconductor"><string name="distribution" value="ggx"/><float name="alpha" value="0.2"/></bsdf>)");
  assumes(R"(<bsdf type="roughdielectric"><string name="distribution" value="Phong"/></bsdf>)",
          "\"phong\" read as beckmann");
}

TEST_F(UpgradeTest, Textures) {
  folder_.write("p.pfm", std::string("PF\n1 1\n-1.0\n") + std::string(12, '\0'));
  const auto texture = [](const std::string& inside) {
    return "<bsdf type=\"diffuse\"><texture type=\"bitmap\" name=\"reflectance\"><string name=\"filename\" value=\"p.pfm\"/>" +
           inside + "</texture></bsdf>";
  };
  // As Mitsuba 3: moved first, then scaled.
  same(texture(
           R"(<float name="uoffset" value="0.25"/><float name="uscale" value="3"/><float name="vscale" value="2"/>)"),
       texture(R"(<transform name="to_uv"><translate x="0.25"/><scale x="3" y="2"/></transform>)"));
  same(
      texture(
          R"(<string name="filterType" value="trilinear"/><string name="wrapModeU" value="clamp"/><string name="wrapModeV" value="clamp"/>)"),
      texture(R"(<string name="wrap_mode" value="clamp"/>)"));
  same(texture(R"(<float name="uvscale" value="3"/><float name="vscale" value="2"/>)"),
       texture(R"(<transform name="to_uv"><scale x="3" y="2"/></transform>)"));
  assumes(texture(R"(<string name="filterType" value="ewa"/>)"), "\"ewa\" read as bilinear");
  assumes(texture(R"(<string name="filterType" value="EWA"/>)"), "\"ewa\" read as bilinear");
  assumes(texture(R"(<string name="wrapMode" value="Zero"/>)"), "\"zero\" read as clamp");
  assumes(texture(R"(<string name="wrapModeU" value="clamp"/><string name="wrapModeV" value="repeat"/>)"),
          "wrap_mode_u");
  assumes(texture(R"(<float name="gamma" value="1.8"/>)"), "gamma 1.8");
  EXPECT_NO_THROW(load(texture(R"(<float name="gamma" value="1"/>)"), "0.6.0"));
}

// As Mitsuba 0.6's ply: colours are sRGB, bytes are shares of 255.
TEST_F(UpgradeTest, ColorsOfVertices) {
  const auto red = [&](const std::string& type, const std::string& value) {
    std::string ply = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n";
    for (const char* channel : {"red", "green", "blue"}) ply += "property " + type + " " + channel + "\n";
    ply += "element face 1\nproperty list uchar int vertex_indices\nend_header\n";
    for (const char* place : {"0 0 0 ", "1 0 0 ", "0 1 0 "}) ply += place + value + " " + value + " " + value + "\n";
    folder_.write("c.ply", ply + "3 0 1 2\n");
    const Scene scene = load(
        R"(<shape type="ply"><string name="filename" value="c.ply"/><bsdf type="diffuse"><texture type="vertexcolors" name="reflectance"/></bsdf></shape>)",
        "0.6.0");
    return scene.textures.back().pixels.at(0).x;
  };
  const float expected = decode_srgb(128.0f / 255.0f);
  EXPECT_NEAR(red("uchar", "128"), expected, 1e-6f);
  EXPECT_NEAR(red("float", std::to_string(128.0 / 255.0)), expected, 1e-5f);
}

// What files of Mitsuba 2 have, and version 3 has not.
TEST_F(UpgradeTest, VersionTwo) {
  const auto film = [](const std::string& radius) {
    return "<sensor type=\"perspective\"><film type=\"hdrfilm\"><rfilter type=\"box\">" + radius +
           "</rfilter></film></sensor>";
  };
  EXPECT_EQ(load(film(R"(<float name="radius" value="0.5"/>)"), "2.0.0").fingerprint,
            load(film(""), "2.0.0").fingerprint);
  EXPECT_THROW(load(film(R"(<float name="radius" value="0.7"/>)"), "2.0.0"), InputError);
  const auto light = [](const std::string& type, const std::string& inside) {
    return "<shape type=\"rectangle\"><emitter type=\"" + type + "\"><rgb name=\"radiance\" value=\"2\"/>" + inside +
           "</emitter></shape>";
  };
  const Scene smooth = load(light("smootharea", R"(<float name="blur_size" value="0.1"/>)"), "2.0.0");
  EXPECT_EQ(smooth.fingerprint, load(light("area", ""), "2.0.0").fingerprint);
  EXPECT_NE(join(smooth.assumed).find("\"smootharea\" read as area"), std::string::npos);
}

TEST_F(UpgradeTest, Colours) {
  same(R"(<bsdf type="diffuse"><srgb name="reflectance" value="#ff8040"/></bsdf>)",
       R"(<bsdf type="diffuse"><rgb name="reflectance" value="#ff8040"/></bsdf>)");
  same(R"(<bsdf type="diffuse"><srgb name="reflectance" value="1, 0, 1"/></bsdf>)",
       R"(<bsdf type="diffuse"><rgb name="reflectance" value="1, 0, 1"/></bsdf>)");
  same(R"(<bsdf type="diffuse"><spectrum name="reflectance" value="0.1 0.2 0.3" intent="reflectance"/></bsdf>)",
       R"(<bsdf type="diffuse"><rgb name="reflectance" value="0.1 0.2 0.3"/></bsdf>)");
  same(
      R"(<shape type="cube"><emitter type="area"><blackbody name="radiance" temperature="3000K"/></emitter></shape>)",
      R"(<shape type="cube"><emitter type="area"><spectrum type="blackbody" name="radiance"><float name="temperature" value="3000"/></spectrum></emitter></shape>)");
  same(
      R"(<bsdf type="roughconductor"><string name="material" value="Cu"/><string name="distribution" value="phong"/><float name="extEta" value="1"/></bsdf>)",
      R"(<bsdf type="roughconductor"><string name="material" value="Cu"/></bsdf>)");
}

TEST_F(UpgradeTest, ModelsOfTheirOwn) {
  // A coat over diffuse is plastic.
  same(
      R"(<bsdf type="coating"><float name="intIOR" value="1.7"/><bsdf type="diffuse"><rgb name="reflectance" value="0.1 0.2 0.3"/></bsdf></bsdf>)",
      R"(<bsdf type="plastic"><float name="int_ior" value="1.7"/><rgb name="diffuse_reflectance" value="0.1 0.2 0.3"/></bsdf>)");
  same(
      R"(<bsdf type="roughcoating"><float name="alpha" value="0.3"/><bsdf type="diffuse"><rgb name="reflectance" value="0.1 0.2 0.3"/></bsdf></bsdf>)",
      R"(<bsdf type="roughplastic"><float name="alpha" value="0.3"/><string name="int_ior" value="bk7"/><rgb name="diffuse_reflectance" value="0.1 0.2 0.3"/></bsdf>)");
  // Two lobes that add up are a blend of each, divided by its share.
  const auto gloss = [](const std::string& alphas) {
    return R"(<bsdf type="blendbsdf"><float name="weight" value="0.25"/><bsdf type="diffuse"><float name="reflectance" value="0.4"/></bsdf>
<bsdf type="roughconductor"><string name="material" value="none"/><float name="specular_reflectance" value="0.4"/>)" +
           alphas + "</bsdf></bsdf>";
  };
  same(
      R"(<bsdf type="phong"><float name="exponent" value="49.5"/><float name="diffuseReflectance" value="0.3"/><float name="specularReflectance" value="0.1"/></bsdf>)",
      gloss(R"(<float name="alpha" value="0.1"/>)"));
  same(
      R"(<bsdf type="ward"><string name="variant" value="balanced"/><float name="alphaU" value="0.2"/><float name="diffuseReflectance" value="0.3"/><float name="specularReflectance" value="0.1"/></bsdf>)",
      gloss(R"(<float name="alpha_u" value="0.2"/><float name="alpha_v" value="0.1"/>)"));
  same(
      R"(<bsdf type="ward"><float name="alpha" value="0.3"/><float name="diffuseReflectance" value="0.3"/><float name="specularReflectance" value="0.1"/></bsdf>)",
      gloss(R"(<float name="alpha_u" value="0.3"/><float name="alpha_v" value="0.3"/>)"));
  same(
      R"(<bsdf type="phong"><float name="exponent" value="49.5"/><srgb name="diffuseReflectance" value="#808080"/><srgb name="specularReflectance" value="#ffffff"/></bsdf>)",
      R"(<bsdf type="phong"><float name="exponent" value="49.5"/><srgb name="diffuseReflectance" value="0.5019607843137255"/><srgb name="specularReflectance" value="1"/></bsdf>)",
      "0.6.0");
  same(
      R"(<bsdf type="roughcoating"><string name="distribution" value="as"/><bsdf type="diffuse"/></bsdf>)",
      R"(<bsdf type="roughplastic"><string name="distribution" value="beckmann"/><string name="int_ior" value="bk7"/></bsdf>)");
  // What a mixture leaves over is absorbed.
  const std::string red = R"(<bsdf type="diffuse"><rgb name="reflectance" value="1 0 0"/></bsdf>)",
                    metal = R"(<bsdf type="conductor"/>)";
  same("<bsdf type=\"blendbsdf\">" + red + metal + "</bsdf>",
       R"(<bsdf type="blendbsdf"><float name="weight" value="0.5"/>)" + red + metal + "</bsdf>");
  EXPECT_THROW(load("<bsdf type=\"blendbsdf\">" + red + metal + "</bsdf>", "3.0.0"), InputError);
  same(R"(<bsdf type="mixturebsdf"><string name="weights" value="0.25, 0.25"/>)" + red + metal + "</bsdf>",
       R"(<bsdf type="blendbsdf"><float name="weight" value="0.75"/>)" + red +
           R"(<bsdf type="blendbsdf"><float name="weight" value="0.6666666666666666"/>)" + metal +
           R"(<bsdf type="diffuse"><float name="reflectance" value="0"/></bsdf></bsdf></bsdf>)");
  same(
      R"(<bsdf type="difftrans"><rgb name="transmittance" value="0.1 0.2 0.3"/></bsdf>)",
      R"(<bsdf type="principledthin"><rgb name="base_color" value="0.1 0.2 0.3"/><float name="diff_trans" value="2"/><float name="roughness" value="1"/></bsdf>)");
  assumes(R"(<bsdf type="phong"/>)", "bsdf \"phong\" read as a blend");
  assumes(R"(<bsdf type="coating"><bsdf type="conductor"/></bsdf>)", "the coat of bsdf \"coating\" left out");
  // What is under a coat takes its place, also where no mask may stand.
  same(R"(<bsdf type="twosided"><bsdf type="coating"><bsdf type="roughconductor"/></bsdf></bsdf>)",
       R"(<bsdf type="twosided"><bsdf type="roughconductor"/></bsdf>)");
  const Scene coated =
      load(R"(<bsdf type="conductor" id="c"/><bsdf type="twosided"><bsdf type="coating"><ref id="c"/></bsdf></bsdf>)",
           "0.6.0");
  EXPECT_EQ(coated.materials.back().type, BsdfType::conductor);
  EXPECT_TRUE(coated.materials.back().two_sided && coated.materials.back().opacity < 0);
  EXPECT_THROW(load(R"(<bsdf type="irawan"/>)", "0.6.0"), InputError);
  EXPECT_THROW(load(R"(<bsdf type="hk"/>)", "0.6.0"), InputError);
  EXPECT_THROW(load(R"(<bsdf type="mixturebsdf"><string name="weights" value="1"/></bsdf>)", "0.6.0"), InputError);
}

TEST_F(UpgradeTest, OldDefaults) {
  assumes(R"(<bsdf type="conductor"/>)", "0.6 took copper");
  same(R"(<bsdf type="diffuse"><rgb name="reflectance" value="1.5 .5 .5"/></bsdf>)",
       R"(<bsdf type="diffuse"><rgb name="reflectance" value="1 .5 .5"/></bsdf>)");
  EXPECT_THROW(load(R"(<bsdf type="diffuse"><rgb name="reflectance" value="1.5 .5 .5"/></bsdf>)", "3.0.0"), InputError);
  folder_.write("t.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
  assumes(R"(<shape type="obj"><string name="filename" value="t.obj"/></shape>)", "materials of .mtl files");
  try {
    load(
        R"(<shape type="obj"><string name="filename" value="t.obj"/><bsdf type="diffuse" name="a"/><bsdf type="diffuse" name="b"/></shape>)",
        "0.6.0");
    ADD_FAILURE();
  } catch (const InputError& error) {
    EXPECT_NE(std::string(error.what()).find("usemtl groups"), std::string::npos) << error.what();
  }
}

// Mip maps of Mitsuba after 3.9.
TEST_F(UpgradeTest, NewerFilters) {
  folder_.write("t.pfm", std::string("PF\n1 1\n-1\n") + std::string(12, '\0'));
  const auto scene = [&](const std::string& texture, const std::string& sensor) {
    return load(
        R"(<sensor type="perspective">)" + sensor +
            R"(</sensor><bsdf type="diffuse"><texture name="reflectance" type="bitmap"><string name="filename" value="t.pfm"/>)" +
            texture + "</texture></bsdf>\n",
        "3.0.0");
  };
  const Scene plain = scene("", "");
  for (const char* filter : {"trilinear", "anisotropic"}) {
    const Scene newer = scene("<string name=\"filter_type\" value=\"" + std::string(filter) +
                                  R"("/><integer name="max_anisotropy" value="8"/>)",
                              R"(<float name="cone_scale" value="2"/><boolean name="jitter" value="true"/>)");
    EXPECT_EQ(newer.fingerprint, plain.fingerprint);
    ASSERT_EQ(newer.assumed.size(), 1u) << join(newer.assumed, "\n");
    EXPECT_NE(newer.assumed[0].find("read as bilinear"), std::string::npos);
  }
  EXPECT_NE(join(scene("", R"(<boolean name="jitter" value="false"/>)").assumed).find("jitter false"),
            std::string::npos);
  EXPECT_THROW(scene(R"(<string name="filter_type" value="cubic"/>)", ""), InputError);
}

// The files of Mitsuba 0.5 and 0.6 among the shared scenes: nothing of what is refused is a name.
TEST(SharedScenes, OldVersions) {
  const std::filesystem::path scenes = shared_folder() / "scenes";
  if (!std::filesystem::is_directory(scenes)) GTEST_SKIP() << "no shared scenes at " << scenes;
  for (const char* name :
       {"bathroom/scene_origin_v0.6.xml", "living-room/scene_origin_v0.6.xml", "kitchen/scene_origin_v0.5_ppg.xml"}) {
    const SceneCheck check = check_scene_file((scenes / name).string());
    EXPECT_FALSE(check.assumed.empty()) << name;
    for (const SceneIssue& issue : check.refused) {
      const bool missing = issue.what.find("does not exist") != std::string::npos;
      EXPECT_TRUE(missing || issue.what.find("sunsky") != std::string::npos) << issue.where << " " << issue.what;
    }
  }
}

// Those of version 3 as they were published. Of one the two meshes of its three teapots could not be obtained; nothing
// else is refused.
TEST(SharedScenes, OriginalsOfVersionThree) {
  const std::filesystem::path scenes = shared_folder() / "scenes";
  if (!std::filesystem::is_directory(scenes)) GTEST_SKIP() << "no shared scenes at " << scenes;
  const std::string ajar = (scenes / "veach-ajar/scene_origin_v3.xml").string();
  const SceneCheck check = check_scene_file(ajar);
  EXPECT_EQ(check.refused.size(), 6u);
  for (const SceneIssue& issue : check.refused) {
    const bool missing = issue.what.find("does not exist") != std::string::npos;
    EXPECT_TRUE(missing && issue.what.find("models/Mesh00") != std::string::npos) << issue.where << " " << issue.what;
  }
  LoadOptions options;
  options.permissive = true;
  const Scene scene = load_scene(ajar, options), whole = load_scene((scenes / "veach-ajar/scene_origmat.xml").string());
  EXPECT_EQ(scene.shapes.size(), whole.shapes.size() - 6);
  EXPECT_EQ(scene.area_lights.size(), whole.area_lights.size());
  EXPECT_TRUE(check_scene_file((scenes / "cornell-box/scene_origin_v3.xml").string()).refused.empty());
}

}  // namespace
}  // namespace octrad
