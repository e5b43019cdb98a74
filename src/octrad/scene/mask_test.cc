// Masks in masks: their opacities multiply.
#include <gtest/gtest.h>

#include "octrad/base/error.h"
#include "octrad/base/folder_test_helper.h"
#include "octrad/image/io.h"
#include "octrad/scene/load.h"
#include "octrad/scene/texture.h"

namespace octrad {
namespace {

const std::string kMaskedDiffuse = "<bsdf type=\"twosided\"><bsdf type=\"diffuse\"/><bsdf type=\"plastic\"/></bsdf>";
const std::string kMaskBitmap =
    "<texture type=\"bitmap\" name=\"opacity\"><string name=\"filename\" value=\"o.exr\"/></texture>";
const std::string kMaskChecks = "<texture type=\"checkerboard\" name=\"opacity\"/>";
std::string mask_constant(const std::string& value) { return "<float name=\"opacity\" value=\"" + value + "\"/>"; }

class MaskTest : public ::testing::Test {
 protected:
  MaskTest() {
    Image image(2, 1, {"Y"});
    image.data = {0.5f, 1.02f};  // the second overshoots
    write_exr(folder_.file("o.exr"), image);
    folder_.write("m.ply",
                  "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
                  "property float weight_0\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n"
                  "0 0 0 0.4\n1 0 0 0.4\n0 1 0 0.4\n3 0 1 2\n");
  }
  Scene load(const std::string& bsdf, const std::string& shape = "<shape type=\"rectangle\">",
             const std::string& version = "3.0.0") const {
    return load_scene(folder_.write("s.xml", "<scene version=\"" + version + "\"><sensor type=\"perspective\"/>\n" +
                                                 shape + bsdf + "</shape></scene>"));
  }
  static std::string masks(const std::string& outer, const std::string& inner) {
    return "<bsdf type=\"mask\">" + outer + "<bsdf type=\"mask\">" + inner + kMaskedDiffuse + "</bsdf></bsdf>";
  }
  static float at(const Scene& scene, Vec2f uv) {
    const Material& m = scene.materials.at(static_cast<std::size_t>(scene.shapes.at(0).material));
    if (m.back >= 0) {
      EXPECT_EQ(scene.materials.at(static_cast<std::size_t>(m.back)).opacity, m.opacity);
    }
    return m.opacity < 0 ? 1.0f
                         : evaluate_texture(texture_view(scene.textures.at(static_cast<std::size_t>(m.opacity))), uv).x;
  }
  TestFolder folder_;
};

TEST_F(MaskTest, OpacitiesMultiply) {
  constexpr Vec2f kFirst{0.25f, 0.5f}, kSecond{0.75f, 0.5f};
  EXPECT_NEAR(at(load(masks(mask_constant("0.5"), mask_constant("0.3"))), kFirst), 0.15f, 1e-6f);
  for (const bool outside : {false, true}) {
    const auto both = [&](const std::string& texture, const std::string& number) {
      return outside ? masks(texture, mask_constant(number)) : masks(mask_constant(number), texture);
    };
    const Scene bitmap = load(both(kMaskBitmap, "0.25"));
    EXPECT_NEAR(at(bitmap, kFirst), 0.125f, 1e-4f);
    EXPECT_NEAR(at(bitmap, kSecond), 0.25f, 1e-4f);
    // Mitsuba exchanges the two where they are a number.
    const Scene checks = load(both(kMaskChecks, "0.5"));
    EXPECT_NEAR(at(checks, {0.25f, 0.75f}), 0.2f, 1e-6f);
    EXPECT_NEAR(at(checks, {0.25f, 0.25f}), 0.1f, 1e-6f);
    const Scene attribute = load(
        both(
            "<texture type=\"mesh_attribute\" name=\"opacity\"><string name=\"name\" value=\"vertex_weight\"/></texture>",
            "0.5"),
        "<shape type=\"ply\"><string name=\"filename\" value=\"m.ply\"/>");
    EXPECT_NEAR(at(attribute, attribute.meshes.at(0).uvs.at(1)), 0.2f, 1e-6f);
    // An opaque mask changes nothing.
    EXPECT_NEAR(at(load(both(kMaskBitmap, "1")), kFirst), 0.5f, 1e-4f);
  }
  const Scene three =
      load("<bsdf type=\"mask\">" + mask_constant("0.5") + masks(kMaskBitmap, mask_constant("0.5")) + "</bsdf>");
  EXPECT_NEAR(at(three, kSecond), 0.25f, 1e-4f);
  // A coat of Mitsuba 0.6 over a mask that has a name.
  const Scene coat = load(
      "<bsdf type=\"coating\"><bsdf type=\"mask\" id=\"m\">" + mask_constant("0.3") + kMaskedDiffuse + "</bsdf></bsdf>",
      "<shape type=\"rectangle\">", "0.6.0");
  EXPECT_NEAR(at(coat, kFirst), 0.3f, 1e-6f);
}

TEST_F(MaskTest, TwoTexturesAreRefused) {
  try {
    load(masks(kMaskBitmap, kMaskChecks));
    ADD_FAILURE();
  } catch (const InputError& error) {
    const std::string text = error.what();
    EXPECT_NE(text.find("s.xml:2:"), std::string::npos) << text;
    EXPECT_NE(text.find("multiply the two pictures into one"), std::string::npos) << text;
  }
}

}  // namespace
}  // namespace octrad
