// Textures "scale" of Mitsuba 0.6, beside files that have the factor in the values.
#include "octrad/scene/scale_textures.h"

#include <gtest/gtest.h>

#include <filesystem>

#include "octrad/base/error.h"
#include "octrad/base/folder_test_helper.h"
#include "octrad/base/join.h"
#include "octrad/image/io.h"
#include "octrad/scene/load.h"
#include "octrad/scene/write_xml.h"

namespace octrad {
namespace {

class ScaleTextures : public ::testing::Test {
 protected:
  ScaleTextures() {
    write("p.exr", {"R", "G", "B"}, {0.5f, 0.25f, 0.75f, 1.0f, 0.5f, 0.0f});
    write("half.exr", {"R", "G", "B"}, {0.25f, 0.125f, 0.375f, 0.5f, 0.25f, 0.0f});
    write("red.exr", {"R", "G", "B"}, {0.5f, 0.125f, 0.0f, 1.0f, 0.25f, 0.0f});
    write("grey.exr", {"Y"}, {0.5f, 1.0f});
    write("grey-half.exr", {"Y"}, {0.25f, 0.5f});
  }
  void write(const std::string& name, const std::vector<std::string>& channels, std::vector<float> values) const {
    Image image(2, 1, channels);
    image.data = std::move(values);
    write_exr(folder_.file(name), image);
  }
  static std::string text(const std::string& body, const std::string& version) {
    return "<scene version=\"" + version + "\"><sensor type=\"perspective\"/>\n" + body +
           "<shape type=\"sphere\"/></scene>";
  }
  Scene load(const std::string& body, const std::string& version = "0.6.0") const {
    return load_scene(folder_.write("s.xml", text(body, version)));
  }
  void same(const std::string& old, const std::string& now) const {
    EXPECT_EQ(load(old).fingerprint, load(now, "3.0.0").fingerprint) << old;
  }
  static std::string bitmap(const std::string& file, const std::string& labels = "", const std::string& more = "") {
    return "<texture type=\"bitmap\" " + labels + "><string name=\"filename\" value=\"" + file + "\"/>" + more +
           "</texture>";
  }
  static std::string scale(const std::string& factor, const std::string& inside, const std::string& labels) {
    return "<texture type=\"scale\" " + labels + ">" + inside + factor + "</texture>";
  }
  static std::string diffuse(const std::string& texture) { return "<bsdf type=\"diffuse\">" + texture + "</bsdf>"; }
  const std::string reflectance_ = "name=\"reflectance\"", half_ = "<float name=\"scale\" value=\"0.5\"/>",
                    red_ = "<rgb name=\"scale\" value=\"1 0.5 0\"/>";
  TestFolder folder_;
};

TEST_F(ScaleTextures, HaveTheFactorInTheirValues) {
  same(diffuse(scale(half_, bitmap("p.exr"), reflectance_)), diffuse(bitmap("half.exr", reflectance_)));
  same(diffuse(scale(red_, bitmap("p.exr"), reflectance_)), diffuse(bitmap("red.exr", reflectance_)));
  same(diffuse(scale(half_, bitmap("grey.exr"), reflectance_)), diffuse(bitmap("grey-half.exr", reflectance_)));
  // What the picture's texture says besides.
  same(diffuse(scale(half_,
                     bitmap("p.exr", "", R"(<string name="wrapMode" value="clamp"/><float name="uscale" value="3"/>)"),
                     reflectance_)),
       diffuse(bitmap(
           "half.exr", reflectance_,
           R"(<string name="wrap_mode" value="clamp"/><transform name="to_uv"><scale x="3" y="1"/></transform>)")));
  same(
      diffuse(scale(half_, R"(<texture type="checkerboard"><rgb name="color0" value="0.2 0.4 0.6"/></texture>)",
                    reflectance_)),
      diffuse(
          R"(<texture type="checkerboard" name="reflectance"><rgb name="color0" value="0.1 0.2 0.3"/><rgb name="color1" value="0.1"/></texture>)"));
  same(diffuse(scale(half_, R"(<rgb name="value" value="0.2 0.4 0.6"/>)", reflectance_)),
       diffuse(R"(<rgb name="reflectance" value="0.1 0.2 0.3"/>)"));
  same(diffuse(scale(half_, R"(<spectrum name="value" value="0.5"/>)", reflectance_)),
       diffuse(R"(<float name="reflectance" value="0.25"/>)"));
  const Scene scene = load(diffuse(scale(half_, bitmap("p.exr"), reflectance_)));
  EXPECT_NE(join(scene.assumed).find("with the factor in its values"), std::string::npos) << join(scene.assumed);
}

TEST_F(ScaleTextures, OfReferencesAndOfOneAnother) {
  const std::string named = bitmap("p.exr", "id=\"p\""), plain = diffuse(bitmap("half.exr", reflectance_));
  // The picture itself keeps its values, before and after.
  const std::string ref = R"(<ref id="p"/>)", use = diffuse(R"(<ref id="p" name="reflectance"/>)");
  for (const std::string& old :
       {named + use + diffuse(scale(half_, ref, reflectance_)),
        diffuse(R"(<ref id="p" name="reflectance"/>)") + diffuse(scale(half_, named, reflectance_))}) {
    const Scene scene = load(old);
    ASSERT_EQ(scene.materials.size(), 3u);
    const auto first = [&](std::size_t m) {
      return scene.textures.at(static_cast<std::size_t>(scene.materials.at(m).reflectance)).pixels.at(0);
    };
    EXPECT_EQ(first(1), Vec3f(0.5f, 0.25f, 0.75f));
    EXPECT_EQ(first(2), Vec3f(0.25f, 0.125f, 0.375f));
  }
  const std::string root = "<float name=\"scale\" value=\"0.25\"/>", twice = "<float name=\"scale\" value=\"2\"/>";
  same(diffuse(scale(twice, scale(root, bitmap("p.exr"), ""), reflectance_)), plain);
  same(scale(root, bitmap("p.exr"), "id=\"s\"") + diffuse(scale(twice, R"(<ref id="s"/>)", reflectance_)), plain);
  same(diffuse(scale(twice, R"(<ref id="s"/>)", reflectance_)) + scale(root, bitmap("p.exr"), "id=\"s\""), plain);
  const std::string one = "<float name=\"scale\" value=\"1\"/>";  // many in one another, from the outside in
  std::string chain = scale(half_, bitmap("p.exr"), "");
  for (int i = 0; i < 39; ++i) chain = scale(one, chain, i == 38 ? reflectance_ : "");
  same(diffuse(chain), plain);
}

TEST_F(ScaleTextures, AreConverted) {
  const std::string file = folder_.write("s.xml", text(diffuse(scale(half_, bitmap("p.exr"), reflectance_)), "0.6.0"));
  Scene scene;
  const SceneFiles files = scene_as_xml(file, folder_.file("out.xml"), {}, scene);
  ASSERT_EQ(files.others.size(), 1u);
  for (const auto& [name, content] : files.others) {
    std::filesystem::create_directories((folder_.path() / name).parent_path());
    folder_.write(name, content());
  }
  EXPECT_EQ(load_scene(folder_.write("out.xml", files.xml)).fingerprint, scene.fingerprint);
}

TEST_F(ScaleTextures, OthersAreRefused) {
  const auto error = [&](const std::string& body) -> std::string {
    try {
      load(body);
    } catch (const InputError& e) {
      return e.what();
    }
    return "no error";
  };
  const auto refused = [&](const std::string& body, const std::string& message) {
    EXPECT_NE(error(body).find(message), std::string::npos) << error(body);
  };
  for (const std::string& inside :
       {std::string(), bitmap("p.exr") + bitmap("p.exr"), std::string("<texture type=\"gridtexture\"/>"),
        std::string("<ref id=\"none\"/>"), std::string("<spectrum name=\"value\" value=\"400:1 500:1\"/>")})
    refused(diffuse(scale(half_, inside, reflectance_)), "texture \"scale\" is not supported");
  refused(diffuse(scale("<texture type=\"bitmap\" name=\"scale\"/>", bitmap("p.exr"), reflectance_)),
          "texture \"scale\" is not supported");
  refused(diffuse(scale("<float name=\"scale\" value=\"-1\"/>", bitmap("p.exr"), reflectance_)),
          "texture \"scale\" is not supported");
  refused(diffuse(scale(half_, bitmap("none.exr"), reflectance_)), "\"none.exr\" does not exist");
  refused(scale(half_, R"(<ref id="b"/>)", "id=\"a\"") + scale(half_, R"(<ref id="a"/>)", "id=\"b\"") +
              diffuse(R"(<ref id="a" name="reflectance"/>)"),
          "texture \"scale\" is not supported");
  // What nothing uses is not looked at, and Mitsuba 3 has no such texture.
  EXPECT_NO_THROW(load(scale(half_, bitmap("none.exr"), "id=\"a\"")));
  EXPECT_THROW(load(diffuse(scale(half_, bitmap("p.exr"), reflectance_)), "3.0.0"), InputError);
  // A name that the file has is not that of a picture that is built.
  EXPECT_EQ(error(diffuse(scale(half_, bitmap("p.exr"), reflectance_)) + diffuse(bitmap("p-scaled0", reflectance_)))
                .find("no error"),
            std::string::npos);
}

}  // namespace
}  // namespace octrad
