// Lists of what a scene file holds that cannot be used, stand-ins for it, and scenes written again.
#include <gtest/gtest.h>

#include <fstream>

#include "octrad/base/error.h"
#include "octrad/base/folder_test_helper.h"
#include "octrad/base/join.h"
#include "octrad/scene/files_test_helper.h"
#include "octrad/scene/load.h"
#include "octrad/scene/write_xml.h"

namespace octrad {
namespace {

const std::string kOneSensor = "<sensor type=\"perspective\"><float name=\"fov\" value=\"60\"/></sensor>\n";

class CheckTest : public ::testing::Test {
 protected:
  std::string write(const std::string& body, const std::string& version = "3.0.0") const {
    return folder_.write("s.xml", "<scene version=\"" + version + "\">\n" + body + kOneSensor + "</scene>\n");
  }
  // "2:1 what" of every mistake.
  std::vector<std::string> mistakes(const std::string& body) const {
    const std::string file = write(body);
    std::vector<std::string> out;
    for (const SceneIssue& issue : check_scene_file(file).refused) {
      EXPECT_EQ(issue.where.rfind(file + ":", 0), 0u) << issue.where;
      out.push_back(issue.where.substr(file.size() + 1) + " " + issue.what);
    }
    return out;
  }
  Scene permissive(const std::string& file) const {
    LoadOptions options;
    options.permissive = true;
    return load_scene(file, options);
  }
  TestFolder folder_;
};

void expect_begins(const std::vector<std::string>& found, const std::vector<std::string>& expected) {
  ASSERT_EQ(found.size(), expected.size()) << join(found, "\n");
  for (std::size_t i = 0; i < found.size(); ++i) EXPECT_EQ(found[i].rfind(expected[i], 0), 0u) << found[i];
}

const std::string kMany = R"(<shape type="sphere" id="a"><bsdf type="velvet"/></shape>
<shape type="teapot"/>
<shape type="obj"><string name="filename" value="none.obj"/></shape>
<bsdf type="diffuse" id="b"><float name="reflectance" value="2"/><float name="shine" value="1"/></bsdf>
<shape type="sphere"><ref id="nobody"/><float name="radius" value="x"/></shape>
<shape type="sphere" id="c"><ref id="b"/><medium name="interior" type="homogeneous"/></shape>
<emitter type="sky"/>
<bsdf type="diffuse"><rgb name="reflectance" value="$color"/></bsdf>
<include filename="none.xml"/>
)";

TEST_F(CheckTest, ListsEverything) {
  expect_begins(mistakes(kMany), {
                                     "9:22 undefined parameter $color",
                                     "10:1 file \"none.xml\" does not exist",
                                     "2:29 bsdf \"velvet\" is not supported",
                                     "3:1 shape \"teapot\" is not supported",
                                     "4:19 file \"none.obj\" does not exist",
                                     "5:29 a reflectance must be between 0 and 1",
                                     "5:66 unknown parameter \"shine\"",
                                     "6:22 <ref>: nothing has the id \"nobody\"",
                                     "7:42 <medium> inside shape \"sphere\" is not supported",
                                     "8:1 emitter \"sky\" is not supported",
                                 });
  EXPECT_TRUE(mistakes("<shape type=\"sphere\"/>").empty());
  // What follows from another mistake says so.
  const SceneCheck check =
      check_scene_file(folder_.write("s.xml", "<scene version=\"3.0.0\">\n<shape type=\"teapot\"/></scene>"));
  ASSERT_EQ(check.refused.size(), 2u);
  EXPECT_EQ(check.refused[1].what.rfind("without what cannot be used the scene has neither", 0), 0u);
  // What no stand-in helps is listed as well.
  expect_begins(
      mistakes(
          "<bsdf type=\"velvet\"/><emitter type=\"point\"><float name=\"sampling_weight\" value=\"0\"/></emitter>"),
      {"2:1 bsdf", "1:1 the sampling_weight of all emitters is 0"});
}

TEST_F(CheckTest, FirstMistakeIsThrownWithoutIt) { EXPECT_THROW(load_scene(write(kMany)), InputError); }

TEST_F(CheckTest, StandIns) {
  const Scene scene = permissive(write(kMany));
  EXPECT_EQ(scene.refused.size(), 10u);
  // The teapot, the missing file and the sphere whose material is missing are left out.
  ASSERT_EQ(scene.shapes.size(), 2u);
  const auto reflectance = [&](int shape) {
    const Material& m =
        scene.materials.at(static_cast<std::size_t>(scene.shapes.at(static_cast<std::size_t>(shape)).material));
    return scene.textures.at(static_cast<std::size_t>(m.reflectance)).color0;
  };
  EXPECT_EQ(reflectance(0), Vec3f(1, 0, 1));
  EXPECT_EQ(reflectance(1), Vec3f(1, 0, 1));
  EXPECT_TRUE(scene.environments.empty());
}

// Mistakes in files that are read at the end: the others stay, with their lights.
TEST_F(CheckTest, BrokenFiles) {
  folder_.write("broken.obj", "v 0 0\n");
  folder_.write("fine.obj", "v 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\n");
  folder_.write("broken.png", "\x89PNG\r\n\x1a\nnothing");
  const std::string light = "<emitter type=\"area\"/>";
  const auto obj = [&](const std::string& name) {
    return "<shape type=\"obj\"><string name=\"filename\" value=\"" + name + "\"/>" + light + "</shape>\n";
  };
  const std::string texture =
      "<texture type=\"bitmap\" name=\"reflectance\"><string name=\"filename\" value=\"broken.png\"/></texture>";
  const std::string file =
      write(obj("fine.obj") + obj("broken.obj") + "<shape type=\"cube\"><bsdf type=\"diffuse\">" + texture + "</bsdf>" +
            light + "</shape>\n<emitter type=\"envmap\"><string name=\"filename\" value=\"broken.png\"/></emitter>");
  EXPECT_EQ(check_scene_file(file).refused.size(), 3u);
  const Scene scene = permissive(file);
  ASSERT_EQ(scene.shapes.size(), 2u);
  ASSERT_EQ(scene.area_lights.size(), 2u);
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_EQ(scene.shapes[i].emitter, static_cast<int>(i));
    EXPECT_EQ(scene.area_lights[i].shape, static_cast<int>(i));
  }
  const Material& m = scene.materials.at(static_cast<std::size_t>(scene.shapes[1].material));
  EXPECT_EQ(scene.textures.at(static_cast<std::size_t>(m.reflectance)).pixels.at(0), Vec3f(1, 0, 1));
  EXPECT_THROW(load_scene(file), InputError);
}

// Whatever is refused by its type says what to do instead.
TEST_F(CheckTest, WaysOut) {
  const auto refused = [this](const std::string& version, const std::string& body) {
    std::string all;
    for (const SceneIssue& issue : check_scene_file(write(body + "<shape type=\"cube\"/>", version)).refused)
      all += issue.what + "\n";
    return all;
  };
  const auto bsdf = [](const std::string& inside) { return "<shape type=\"cube\">" + inside + "</shape>"; };
  const auto texture = [&](const std::string& inside) { return bsdf("<bsdf type=\"diffuse\">" + inside + "</bsdf>"); };
  const std::vector<std::array<std::string, 3>> cases = {
      {"3.0.0", bsdf(R"(<bsdf type="phong"/>)"), "read in files that say so: <scene version=\"0.6.0\">"},
      {"0.6.0", texture(R"(<texture name="reflectance" type="scale"/>)"), "multiply the picture"},
      {"0.6.0", texture(R"(<texture name="reflectance" type="gridtexture"/>)"), "bake it into a bitmap"},
      {"0.6.0",
       texture(
           R"(<texture name="reflectance" type="bitmap"><string name="filename" value="t.png"/><string name="channel" value="a"/></texture>)"),
       "save the channel \"a\" as a picture of its own"},
      {"3.0.0",
       texture(
           R"(<texture name="reflectance" type="checkerboard"><texture name="color0" type="checkerboard"/></texture>)"),
       "bake one of textures into a bitmap"},
      {"3.0.0", bsdf(R"(<bsdf type="roughplastic"><texture name="alpha" type="checkerboard"/></bsdf>)"),
       "give a number, not a texture"},
      {"0.6.0", R"(<shape type="heightfield"/>)", "turn it into triangles"},
      {"3.0.0", bsdf(R"(<emitter type="directionalarea"/>)"), "directional outside of shapes"},
      {"0.6.0", R"(<emitter type="collimated"/>)", "small cutoff_angle"},
  };
  for (const auto& [version, body, text] : cases) {
    const std::string all = refused(version, body);
    EXPECT_NE(all.find(text), std::string::npos) << body << "\n" << all;
  }
}

TEST_F(CheckTest, Assumptions) {
  const Scene scene = load_scene(folder_.write("s.xml", R"(<scene version="3.0.0">
<integrator type="$integrator"><integer name="max_depth" value="$depth"/></integrator>
<sensor type="perspective"><sampler type="independent"><integer name="sample_count" value="$spp"/></sampler>
<film type="hdrfilm"><integer name="width" value="$resx"/><integer name="height" value="$resy"/></film></sensor>
<shape type="sphere"/></scene>)"));
  EXPECT_EQ(scene.film.width, 768);
  EXPECT_EQ(scene.film.height, 576);
  EXPECT_EQ(scene.max_depth, -1);
  ASSERT_EQ(scene.assumed.size(), 5u);
  EXPECT_NE(scene.assumed[0].find("$integrator has no value"), std::string::npos);
  EXPECT_NE(scene.assumed[3].find("$resx has no value: 768"), std::string::npos);
  const auto depth = [&](const std::string& integrator) {
    return load_scene(write(integrator + "<shape type=\"sphere\"/>"));
  };
  EXPECT_NE(depth("stray text").assumed.at(0).find("text inside <scene> left out"), std::string::npos);
  const std::string hiding = "<integrator type=\"path\"><boolean name=\"hide_emitters\" value=\"true\"/></integrator>";
  EXPECT_TRUE(depth(hiding).hide_emitters);
  EXPECT_TRUE(depth(hiding).assumed.empty());
  EXPECT_TRUE(depth("<integrator type=\"aov\">" + hiding + "</integrator>").hide_emitters);
  EXPECT_FALSE(depth("<integrator type=\"path\"/>").hide_emitters);
  EXPECT_EQ(depth("<integrator type=\"volpath\"><integer name=\"max_depth\" value=\"7\"/></integrator>").max_depth, 7);
  EXPECT_NE(depth("<integrator type=\"volpath\"/>").assumed.at(0).find("\"volpath\" read as path"), std::string::npos);
  EXPECT_EQ(
      depth(
          "<integrator type=\"moment\"><integrator type=\"path\"><integer name=\"max_depth\" value=\"5\"/></integrator></integrator>")
          .max_depth,
      5);
  EXPECT_TRUE(depth("<integrator type=\"path\"/>").assumed.empty());
  EXPECT_EQ(depth("<integrator type=\"direct\"/>").max_depth, 2);
  EXPECT_NE(join(depth("<default name=\"idle\" value=\"1\"/>").warnings).find("the parameter \"idle\" is not used"),
            std::string::npos);
}

TEST_F(CheckTest, NamesOfFilesFromOtherSystems) {
  std::filesystem::create_directories(folder_.file("models"));
  folder_.write("models/a.obj", "v 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\n");
  EXPECT_EQ(
      load_scene(write(R"(<shape type="obj"><string name="filename" value="models\a.obj"/></shape>)")).shapes.size(),
      1u);
}

// One emitter at the top level, in several shapes.
TEST_F(CheckTest, SharedObjects) {
  const std::string body = R"(<emitter type="area" id="light"><rgb name="radiance" value="1 2 3"/></emitter>
<spectrum type="d65" id="white"/><texture type="checkerboard" id="check"/>
<bsdf type="diffuse" id="m"><ref name="reflectance" id="check"/></bsdf>
<shape type="cube"><ref id="light"/><ref id="m"/></shape>
<shape type="sphere"><ref id="light"/></shape><shape type="sphere"><emitter type="area"><ref name="radiance" id="white"/></emitter></shape>
)";
  const Scene scene = load_scene(write(body));
  ASSERT_EQ(scene.area_lights.size(), 3u);
  EXPECT_EQ(scene.area_lights[0].radiance, scene.area_lights[1].radiance);
  EXPECT_EQ(scene.textures.at(static_cast<std::size_t>(scene.area_lights[0].radiance)).color0, Vec3f(1, 2, 3));
  EXPECT_EQ(scene.textures.at(static_cast<std::size_t>(scene.area_lights[2].radiance)).color0, Vec3f(1, 1, 1));
}

class ConvertTest : public CheckTest {
 protected:
  // Reads `file`, writes it and reads that: the same scene, and no assumptions any more.
  std::string round_trip(const std::string& file, bool with_stand_ins = false) const {
    LoadOptions options;
    options.permissive = with_stand_ins;
    Scene first;
    const std::string output = folder_.file("out.xml");
    const std::string text = scene_as_xml(file, output, options, first).xml;
    std::ofstream(output) << text;
    const Scene second = load_scene(output);
    EXPECT_EQ(second.fingerprint, first.fingerprint) << text;
    EXPECT_EQ(second.cameras.size(), first.cameras.size());
    EXPECT_EQ(second.film.width, first.film.width);
    EXPECT_EQ(second.max_depth, first.max_depth);
    EXPECT_EQ(second.hide_emitters, first.hide_emitters);
    EXPECT_EQ(second.assumed.size(), 0u) << join(second.assumed, "\n");
    EXPECT_EQ(second.warnings.size(), first.area_lights.empty() && first.environments.empty() ? 1u : 0u)  // no emitter
        << join(second.warnings, "\n");
    return text;
  }
};

TEST_F(ConvertTest, SensorThatWasAdded) {
  const std::string file =
      folder_.write("s.xml", R"(<scene version="3.0.0"><shape type="sphere"/><emitter type="constant"/></scene>)");
  EXPECT_NE(round_trip(file).find("<sensor type=\"perspective\">"), std::string::npos);
}

TEST_F(ConvertTest, RoundTrip) {
  folder_.write("fine.obj", "v 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\n");
  std::filesystem::create_directories(folder_.file("sub"));
  folder_.write(
      "sub/part.xml",
      R"(<scene version="0.6.0"><bsdf type="plastic" id="old"><float name="intIOR" value="1.6"/></bsdf></scene>)");
  const std::string text =
      round_trip(write(R"(<path value="sub"/><include filename="part.xml"/><alias id="old" as="older"/>
<default name="r" value="0.3"/>
<integrator type="volpath"><integer name="max_depth" value="9"/><boolean name="hideEmitters" value="true"/></integrator>
<emitter type="area" id="light"><spectrum name="radiance" value="400:1, 700:3"/></emitter>
<bsdf type="diffuse" id="m"><rgb name="reflectance" value="#ff8040"/></bsdf>
<bsdf type="mask" id="half"><float name="opacity" value="$r"/><ref id="m"/></bsdf>
<shape type="obj"><string name="filename" value="fine.obj"/><ref id="older"/><transform name="to_world"><rotate y="2" angle="33"/><scale value="1.5"/></transform></shape>
<shape type="cube"><ref id="light"/><ref id="half"/></shape><shape type="sphere"><ref id="light"/><point name="center" x="1" y="2" z="3"/></shape>
)"));
  EXPECT_EQ(text.find("$"), std::string::npos);
  EXPECT_EQ(text.find("<include"), std::string::npos);
  EXPECT_EQ(text.find("volpath"), std::string::npos);
  EXPECT_NE(text.find("value=\"fine.obj\""), std::string::npos);
  round_trip(write(kMany), true);
  EXPECT_THROW(round_trip(write(kMany)), InputError);
}

// Their shapes, and the lights on them, are left out.
TEST_F(ConvertTest, MeshesWithoutTriangles) {
  folder_.write("points.obj", "v 1 0 0\nv 0 1 0\nf 1 2\n");
  const std::string file = write(
      R"(<shape type="obj"><string name="filename" value="points.obj"/><bsdf type="conductor" id="m"/><emitter type="area"/></shape>
<shape type="shapegroup" id="g"><shape type="obj"><string name="filename" value="points.obj"/></shape><shape type="cube"/></shape>
<shape type="instance"><ref id="g"/></shape>
<shape type="sphere"><ref id="m"/><emitter type="area"/></shape>
)");
  const Scene scene = load_scene(file);
  ASSERT_EQ(scene.shapes.size(), 2u);
  ASSERT_EQ(scene.area_lights.size(), 1u);
  EXPECT_EQ(scene.area_lights[0].shape, 1);
  EXPECT_EQ(scene.shapes[1].emitter, 0);
  EXPECT_NE(join(scene.assumed).find("points.obj has no triangle: its shape is left out"), std::string::npos);
  EXPECT_EQ(round_trip(file).find("points.obj"), std::string::npos);
}

// A file that holds the colour of a light cannot hold that of a surface in the same place.
TEST_F(ConvertTest, OneSpectrumAsLightAndAsReflectance) {
  const std::string file = write(R"(<spectrum type="regular" id="s"><float name="wavelength_min" value="400"/>
<float name="wavelength_max" value="700"/><string name="values" value="0.1, 0.9"/></spectrum>
<shape type="sphere"><bsdf type="diffuse"><ref name="reflectance" id="s"/></bsdf>
<emitter type="area"><ref name="radiance" id="s"/></emitter></shape>)");
  Scene scene = load_scene(file);
  EXPECT_THROW(scene_as_xml(file, folder_.file("o.xml"), {}, scene), InputError);
}

// Of Mitsuba 0.6 alone.
TEST_F(ConvertTest, WhatMitsubaCannotSay) {
  Scene scene;
  const std::string text =
      scene_as_xml(
          write(R"(<shape type="sphere"><bsdf type="roughdiffuse"><float name="alpha" value="0.3"/></bsdf></shape>)"),
          folder_.file("o.xml"), {}, scene)
          .xml;
  EXPECT_NE(text.find("<bsdf type=\"diffuse\">"), std::string::npos) << text;
  EXPECT_EQ(text.find("alpha"), std::string::npos) << text;
  EXPECT_NE(join(scene.assumed).find("written as diffuse"), std::string::npos);
}

TEST_F(ConvertTest, SharedScenes) {
  const std::filesystem::path scenes = shared_folder() / "scenes";
  if (!std::filesystem::is_directory(scenes)) GTEST_SKIP() << "no shared scenes at " << scenes;
  for (const char* name : {"cornell-box/scene_origin_v3.xml", "cbox-mitsuba/scene.xml"})
    round_trip((scenes / name).string());
}

// What people's files have.
TEST_F(CheckTest, FilmsOfOtherPrograms) {
  const std::string film = R"(<integer name="width" value="99"/><rfilter type="box"/>)";
  const auto scene = [&](const std::string& type, const std::string& more) {
    return load_scene(folder_.write(
        "s.xml", R"(<scene version="3.0.0"><shape type="sphere"/><sensor type="perspective"><film type=")" + type +
                     "\">" + film + more + "</film></sensor></scene>"));
  };
  const Scene other =
      scene("transient_hdr_film", R"(<rfilter name="tfilter" type="box"/><float name="bin_width" value="2"/>)");
  EXPECT_EQ(other.film.width, 99);
  EXPECT_EQ(other.film.filter, scene("hdrfilm", "").film.filter);
  EXPECT_NE(join(other.assumed).find("film \"transient_hdr_film\" read as hdrfilm"), std::string::npos);
}

TEST_F(CheckTest, TexturesCalledSpectra) {
  folder_.write("t.pfm", std::string("PF\n1 1\n-1\n") + std::string(12, '\0'));
  const auto scene = [&](const std::string& tag) {
    const auto textured = [&](const std::string& name) {
      return "<" + tag + " type=\"bitmap\" name=\"" + name + R"("><string name="filename" value="t.pfm"/></)" + tag +
             ">";
    };
    return load_scene(write(R"(<shape type="cube"><bsdf type="bumpmap">)" + textured("arbitrary") +
                            R"(<bsdf type="diffuse">)" + textured("reflectance") + "</bsdf></bsdf></shape>"))
        .fingerprint;
  };
  EXPECT_EQ(scene("spectrum"), scene("texture"));
}

TEST_F(CheckTest, IntegratorsInside) {
  const auto depth = [&](const std::string& inside) {
    const Scene scene =
        load_scene(write("<integrator type=\"aov\">" + inside + "</integrator><shape type=\"sphere\"/>"));
    return std::pair(scene.max_depth, scene.hide_emitters);
  };
  const std::string path =
      R"(<integrator type="path"><integer name="max_depth" value="3"/><boolean name="hide_emitters" value="true"/></integrator>)";
  EXPECT_EQ(depth(path), std::pair(3, true));
  EXPECT_EQ(depth(path + "<integrator type=\"depth\"/>"), std::pair(3, true));
  EXPECT_EQ(depth("<integrator type=\"field\"/>" + path), std::pair(3, true));
}

TEST_F(CheckTest, MediaThatNothingUses) {
  EXPECT_TRUE(mistakes(R"(<medium type="homogeneous" id="m"/><shape type="sphere"/>)").empty());
  expect_begins(
      mistakes(R"(<medium type="homogeneous" id="m"/><shape type="sphere"><ref name="interior" id="m"/></shape>)"),
      {"2:57 <medium> inside shape"});
}

// Beside a sensor that can be used; alone they are refused.
TEST_F(CheckTest, SensorsThatAreLeftOut) {
  const std::string sphere = "<shape type=\"sphere\"/>";
  const std::string plain = load_scene(write(sphere)).fingerprint;
  for (const auto& [body, way] :
       {std::pair(R"(<sensor type="batch"/>)" + sphere, "one by one at the top level"),
        std::pair(R"(<sensor type="radiancemeter"/>)" + sphere, "octrad query"),
        std::pair(std::string(R"(<shape type="sphere"><sensor type="irradiancemeter"/></shape>)"),
                  "octrad query gives values")}) {
    const Scene scene = load_scene(write(body));
    EXPECT_EQ(scene.fingerprint, plain) << body;
    EXPECT_EQ(scene.cameras.size(), 1u);
    EXPECT_NE(join(scene.assumed).find(way), std::string::npos) << join(scene.assumed);
  }
  EXPECT_EQ(mistakes(R"(<sensor type="perspectiv"/>)" + sphere).size(), 1u);  // a mistake in writing
  const std::string alone =
      folder_.write("alone.xml", "<scene version=\"3.0.0\">" + sphere + "<sensor type=\"distant\"/></scene>");
  const auto refused = check_scene_file(alone).refused;
  ASSERT_EQ(refused.size(), 1u);
  EXPECT_NE(refused[0].what.find("use orthographic"), std::string::npos) << refused[0].what;
}

// Of Mitsuba 3's ADIntegrator; light that is scattered once has one more segment than what is emitted.
TEST_F(CheckTest, DepthOfDifferentiableIntegrators) {
  const auto depth = [&](const std::string& type, const std::string& inside = "") {
    return load_scene(write("<integrator type=\"" + type + "\">" + inside + "</integrator><shape type=\"sphere\"/>"))
        .max_depth;
  };
  for (const char* type : {"prb", "prb_basic", "prb_projective", "prbvolpath"}) EXPECT_EQ(depth(type), 6) << type;
  EXPECT_EQ(depth("prb", R"(<integer name="max_depth" value="-1"/>)"), -1);
  EXPECT_EQ(depth("prb", R"(<integer name="max_depth" value="4"/>)"), 4);
  EXPECT_EQ(depth("direct_projective"), 2);
  EXPECT_EQ(depth("volpath"), -1);
}

TEST_F(CheckTest, WhatStandsInARefusedShape) {
  expect_begins(mistakes("<shape type=\"sdfgrid\"><bsdf type=\"disney\"/></shape><shape type=\"cube\"/>"),
                {"2:23 bsdf \"disney\" is not supported", "2:1 shape \"sdfgrid\" is not supported"});
}

TEST_F(CheckTest, WaysOutOfMore) {
  const auto says = [&](const std::string& body, const std::string& text) {
    const std::vector<std::string> found = mistakes(body);
    ASSERT_FALSE(found.empty()) << body;
    EXPECT_NE(found[0].find(text), std::string::npos) << found[0];
  };
  says(R"(<shape type="sphere"><bsdf type="itu-radio-material"/></shape>)", "a material of radio waves");
  says(
      R"(<shape type="sphere"><bsdf type="normalmap"><string name="filename" value="n.png"/><bsdf type="diffuse"/></bsdf></shape>)",
      "belongs into a bitmap");
  says(R"(<emitter type="avg_sunsky"/><shape type="sphere"/>)", "bake it to a picture");
  says(R"(<luminaire type="point"/><shape type="sphere"/>)", "now called <emitter>");
  says(R"(<shape type="sphere"><luminaire type="area"/></shape>)", "now called <emitter>");
  says(R"(<sensor type="thinlens"><float name="aperture_radius" value="1e19"/></sensor><shape type="sphere"/>)",
       "up to 1e9");
  // What two objects meet is listed once.
  EXPECT_EQ(
      mistakes(
          R"(<bsdf type="velvet" id="v"/><shape type="sphere"><ref id="v"/></shape><shape type="sphere"><ref id="v"/></shape>)")
          .size(),
      1u);
}

}  // namespace
}  // namespace octrad
