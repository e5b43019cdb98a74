// Texture values and gradients against Mitsuba 3.9.1's (Texture.eval, eval_1 and eval_1_grad) on a 3 x 2 picture.
#include "octrad/scene/texture.h"

#include <gtest/gtest.h>

#include <cmath>
#include <span>

#include "octrad/base/error.h"
#include "octrad/base/folder_test_helper.h"
#include "octrad/base/join.h"
#include "octrad/image/io.h"
#include "octrad/scene/load.h"

namespace octrad {
namespace {

struct Sample {
  Vec2f uv;
  Vec3f color;
  float scalar;
  Vec2f gradient;
};

const Sample k_linear[] = {
    {{0.1f, 0.2f}, {0.271f, 0.221f, 0.305f}, 0.2376958f, {-0.733634f, -0.126043f}},
    {{0.5f, 0.5f}, {0.6f, 0.4f, 0.6f}, 0.456968f, {0.171045f, -0.515927f}},
    {{0.95f, 0.9f}, {0.39775f, 0.44525f, 0.40625f}, 0.4323336f, {-1.0455f, -0.281975f}},
    {{1.3f, -0.4f}, {0.4419999f, 0.206f, 0.614f}, 0.2856353f, {0.5987f, -0.172327f}},
    {{-2.7f, 3.1f}, {0.3379999f, 0.2939999f, 0.526f}, 0.3201006f, {0.9423f, 0.172327f}},
    {{0, 0}, {0.4125f, 0.3375f, 0.3875f}, 0.3570588f, {-0.941545f, -0.229998f}},
    {{1, 1}, {0.4125f, 0.3375f, 0.3875f}, 0.3570588f, {-0.941545f, -0.229998f}},
    {{0.34f, 0.75f}, {0.556f, 0.152f, 0.6440001f}, 0.2734262f, {0.341f, 0.241047f}},
};
const Sample k_srgb[] = {
    {{0.1f, 0.2f}, {0.1615259f, 0.04809064f, 0.1041993f}, 0.07626434f, {-0.605446f, -0.145012f}},
    {{0.5f, 0.5f}, {0.3305309f, 0.1758257f, 0.3305309f}, 0.219892f, {0.257463f, -0.343828f}},
    {{0.95f, 0.9f}, {0.211268f, 0.2571529f, 0.2029946f}, 0.243486f, {-0.824787f, -0.254682f}},
    {{1.3f, -0.4f}, {0.2082237f, 0.05779229f, 0.3804817f}, 0.1130729f, {0.362181f, -0.0797695f}},
    {{-2.7f, 3.1f}, {0.1421199f, 0.1089289f, 0.2896028f}, 0.1290267f, {0.626239f, 0.0797694f}},
    {{0, 0}, {0.2464414f, 0.1591755f, 0.196582f}, 0.180434f, {-0.751674f, -0.218125f}},
    {{1, 1}, {0.2464414f, 0.1591755f, 0.196582f}, 0.180434f, {-0.751674f, -0.218125f}},
    {{0.34f, 0.75f}, {0.2952815f, 0.02217278f, 0.4020847f}, 0.107673f, {0.164138f, 0.132581f}},
};
const Sample k_raw[] = {
    {{0.1f, 0.2f}, {0.2727843f, 0.2207843f, 0.3039216f}, 0.2378432f, {-0.730023f, -0.127958f}},
    {{0.5f, 0.5f}, {0.6f, 0.4f, 0.6f}, 0.456968f, {0.168934f, -0.517029f}},
    {{0.95f, 0.9f}, {0.3987843f, 0.4449021f, 0.4059804f}, 0.4322852f, {-1.04036f, -0.283129f}},
    {{1.3f, -0.4f}, {0.4420392f, 0.2068235f, 0.6139609f}, 0.2862298f, {0.595176f, -0.171416f}},
    {{-2.7f, 3.1f}, {0.3391372f, 0.2943528f, 0.5248628f}, 0.3205128f, {0.94079f, 0.171416f}},
    {{0, 0}, {0.4137255f, 0.3372549f, 0.3872549f}, 0.3571264f, {-0.936917f, -0.231405f}},
    {{1, 1}, {0.4137255f, 0.3372549f, 0.3872549f}, 0.3571264f, {-0.936917f, -0.231405f}},
    {{0.34f, 0.75f}, {0.5549804f, 0.1529412f, 0.6450197f}, 0.2739561f, {0.335966f, 0.240538f}},
};
const Sample k_grey[] = {
    {{0.1f, 0.2f}, {0.1615259f, 0.1615259f, 0.1615259f}, 0.1615259f, {-2.08413f, 0.0999496f}},
    {{0.5f, 0.5f}, {0.3305309f, 0.3305309f, 0.3305309f}, 0.3305309f, {0.272258f, 0.458682f}},
    {{0.95f, 0.9f}, {0.211268f, 0.211268f, 0.211268f}, 0.211268f, {-0.531513f, 0.87626f}},
    {{1.3f, -0.4f}, {0.2082237f, 0.2082237f, 0.2082237f}, 0.2082237f, {0.840877f, 0.330519f}},
    {{-2.7f, 3.1f}, {0.1421199f, 0.1421199f, 0.1421199f}, 0.1421199f, {0.712714f, -0.330519f}},
    {{0, 0}, {0.2464414f, 0.2464414f, 0.2464414f}, 0.2464414f, {-1.04905f, 0.61749f}},
    {{1, 1}, {0.2464414f, 0.2464414f, 0.2464414f}, 0.2464414f, {-1.04905f, 0.61749f}},
    {{0.34f, 0.75f}, {0.2952815f, 0.2952815f, 0.2952815f}, 0.2952815f, {0.936999f, -0.356152f}},
};
const Sample k_nearest[] = {
    {{0.1f, 0.2f}, {0.1f, 0.2f, 0.3f}, 0.1859498f, {0, 0}},
    {{0.5f, 0.5f}, {0.7f, 0.2f, 0.5f}, 0.3279862f, {0, 0}},
    {{0.95f, 0.9f}, {0.25f, 0.75f, 0.35f}, 0.6147969f, {0, 0}},
    {{1.3f, -0.4f}, {0.4f, 0.1f, 0.8f}, 0.2143196f, {0, 0}},
    {{-2.7f, 3.1f}, {0.1f, 0.2f, 0.3f}, 0.1859498f, {0, 0}},
    {{0, 0}, {0.1f, 0.2f, 0.3f}, 0.1859498f, {0, 0}},
    {{1, 1}, {0.1f, 0.2f, 0.3f}, 0.1859498f, {0, 0}},
    {{0.34f, 0.75f}, {0.7f, 0.2f, 0.5f}, 0.3279862f, {0, 0}},
};
const Sample k_mirror[] = {
    {{0.1f, 0.2f}, {0.1f, 0.2f, 0.3f}, 0.1859498f, {0, 0}},
    {{0.5f, 0.5f}, {0.6f, 0.4f, 0.6f}, 0.456968f, {0.171045f, -0.515927f}},
    {{0.95f, 0.9f}, {0.25f, 0.75f, 0.35f}, 0.6147969f, {0, 0}},
    {{1.3f, -0.4f}, {0.6470001f, 0.453f, 0.3609999f}, 0.4876186f, {0.104711f, -0.035583f}},
    {{-2.7f, 3.1f}, {0.4299998f, 0.5300002f, 0.41f}, 0.5000727f, {-0.860432f, 0}},
    {{0, 0}, {0.1f, 0.2f, 0.3f}, 0.1859498f, {0, 0}},
    {{1, 1}, {0.25f, 0.75f, 0.35f}, 0.6147969f, {0, 0}},
    {{0.34f, 0.75f}, {0.556f, 0.152f, 0.6440001f}, 0.2734262f, {0.341f, 0}},
};
const Sample k_clamp[] = {
    {{0.1f, 0.2f}, {0.1f, 0.2f, 0.3f}, 0.1859498f, {0, 0}},
    {{0.5f, 0.5f}, {0.6f, 0.4f, 0.6f}, 0.456968f, {0.171045f, -0.515927f}},
    {{0.95f, 0.9f}, {0.25f, 0.75f, 0.35f}, 0.6147969f, {0, 0}},
    {{1.3f, -0.4f}, {0.9f, 0.3f, 0.1f}, 0.4131688f, {0, 0}},
    {{-2.7f, 3.1f}, {0.4f, 0.1f, 0.8f}, 0.2143196f, {0, 0}},
    {{0, 0}, {0.1f, 0.2f, 0.3f}, 0.1859498f, {0, 0}},
    {{1, 1}, {0.25f, 0.75f, 0.35f}, 0.6147969f, {0, 0}},
    {{0.34f, 0.75f}, {0.556f, 0.152f, 0.6440001f}, 0.2734262f, {0.341f, 0}},
};
const Sample k_mirror_nearest[] = {
    {{0.1f, 0.2f}, {0.1f, 0.2f, 0.3f}, 0.1859498f, {0, 0}},
    {{0.5f, 0.5f}, {0.7f, 0.2f, 0.5f}, 0.3279862f, {0, 0}},
    {{0.95f, 0.9f}, {0.25f, 0.75f, 0.35f}, 0.6147969f, {0, 0}},
    {{1.3f, -0.4f}, {0.9f, 0.3f, 0.1f}, 0.4131688f, {0, 0}},
    {{-2.7f, 3.1f}, {0.25f, 0.75f, 0.35f}, 0.6147969f, {0, 0}},
    {{0, 0}, {0.1f, 0.2f, 0.3f}, 0.1859498f, {0, 0}},
    {{1, 1}, {0.25f, 0.75f, 0.35f}, 0.6147969f, {0, 0}},
    {{0.34f, 0.75f}, {0.7f, 0.2f, 0.5f}, 0.3279862f, {0, 0}},
};
const Sample k_rotated[] = {
    {{0.1f, 0.2f}, {0.40781f, 0.5720595f, 0.3308364f}, 0.5197196f, {-1.30347f, 2.00589f}},
    {{0.5f, 0.5f}, {0.3619437f, 0.2003631f, 0.6863213f}, 0.2697977f, {-2.15672f, 0.866267f}},
    {{0.95f, 0.9f}, {0.2745419f, 0.3380134f, 0.4721075f}, 0.3341923f, {1.71783f, -1.56166f}},
    {{1.3f, -0.4f}, {0.843127f, 0.3035413f, 0.1166804f}, 0.40481f, {-0.623757f, 1.69103f}},
    {{-2.7f, 3.1f}, {0.6577335f, 0.4526911f, 0.3948772f}, 0.4921253f, {-0.457289f, 0.133788f}},
    {{0, 0}, {0.4125f, 0.3375f, 0.3875f}, 0.3570588f, {-1.9758f, 0.343992f}},
    {{1, 1}, {0.3736514f, 0.1678801f, 0.6309507f}, 0.2450611f, {0.959318f, -0.746433f}},
    {{0.34f, 0.75f}, {0.4729348f, 0.5283368f, 0.6471004f}, 0.5251254f, {1.28287f, -2.31303f}},
};
const Sample k_checker[] = {
    {{0.1f, 0.2f}, {0.4f, 0.4f, 0.4f}, 0, {0, 0}},  {{0.5f, 0.5f}, {0.4f, 0.4f, 0.4f}, 0, {0, 0}},
    {{0.95f, 0.9f}, {0.4f, 0.4f, 0.4f}, 0, {0, 0}}, {{1.3f, -0.4f}, {0.2f, 0.2f, 0.2f}, 0, {0, 0}},
    {{-2.7f, 3.1f}, {0.4f, 0.4f, 0.4f}, 0, {0, 0}}, {{0, 0}, {0.4f, 0.4f, 0.4f}, 0, {0, 0}},
    {{1, 1}, {0.4f, 0.4f, 0.4f}, 0, {0, 0}},        {{0.34f, 0.75f}, {0.2f, 0.2f, 0.2f}, 0, {0, 0}},
};
const Sample k_checker_scaled[] = {
    {{0.1f, 0.2f}, {0.9f, 0.9f, 0.9f}, 0, {0, 0}},  {{0.5f, 0.5f}, {0.1f, 0.2f, 0.3f}, 0, {0, 0}},
    {{0.95f, 0.9f}, {0.1f, 0.2f, 0.3f}, 0, {0, 0}}, {{1.3f, -0.4f}, {0.1f, 0.2f, 0.3f}, 0, {0, 0}},
    {{-2.7f, 3.1f}, {0.9f, 0.9f, 0.9f}, 0, {0, 0}}, {{0, 0}, {0.1f, 0.2f, 0.3f}, 0, {0, 0}},
    {{1, 1}, {0.1f, 0.2f, 0.3f}, 0, {0, 0}},        {{0.34f, 0.75f}, {0.9f, 0.9f, 0.9f}, 0, {0, 0}},
};
const Sample k_scaled[] = {
    {{0.1f, 0.2f}, {0.343f, 0.149f, 0.641f}, 0.2257653f, {1.1974f, -0.001581244f}},
    {{0.95f, 0.9f}, {0.3260002f, 0.586f, 0.4099998f}, 0.5180038f, {-2.298909f, 1.001859f}},
    {{1.3f, -0.4f}, {0.5705001f, 0.3794999f, 0.4615f}, 0.426038f, {1.44511f, 0.7205171f}},
    {{-2.7f, 3.1f}, {0.6144999f, 0.4955004f, 0.5135006f}, 0.5221072f, {-0.7609351f, -0.7205184f}},
    {{0.34f, 0.75f}, {0.716f, 0.438f, 0.376f}, 0.4926481f, {-1.036686f, -0.05870435f}},
};
const Sample k_turned[] = {
    {{0.1f, 0.2f}, {0.5207295f, 0.2645821f, 0.2115192f}, 0.3152277f, {-0.7973991f, 0.02525841f}},
    {{0.95f, 0.9f}, {0.3493758f, 0.444744f, 0.5478641f}, 0.431904f, {0.8096997f, -0.6549081f}},
    {{1.3f, -0.4f}, {0.3180357f, 0.3649282f, 0.5087647f}, 0.3653361f, {0.7969666f, -0.5569857f}},
    {{-2.7f, 3.1f}, {0.2561361f, 0.2148959f, 0.3447398f}, 0.2330372f, {-0.5811809f, 0.3551563f}},
    {{0.34f, 0.75f}, {0.3450027f, 0.5392639f, 0.4225162f}, 0.4895246f, {-1.213186f, 0.1046853f}},
};

constexpr float kPixels[18] = {.1f, .2f, .3f, .5f, .6f, .7f, .9f,  .3f,  .1f,
                               .4f, .1f, .8f, .7f, .2f, .5f, .25f, .75f, .35f};

// The picture as EXR, as 8-bit PNG, and its red channel as grey PNG.
class TextureTest : public ::testing::Test {
 protected:
  TextureTest() {
    Image image(3, 2, {"R", "G", "B"});
    image.data.assign(kPixels, kPixels + 18);
    write_exr(folder_.file("t.exr"), image);
    Image8 bytes(3, 2, 3), grey(3, 2, 1);
    for (std::size_t i = 0; i < 18; ++i)
      bytes.data[i] = static_cast<std::uint8_t>(std::lround(std::nearbyint(kPixels[i] * 255.0f)));
    for (std::size_t i = 0; i < 6; ++i) grey.data[i] = bytes.data[3 * i];
    write_image(folder_.file("t.png"), bytes);
    write_image(folder_.file("g.png"), grey);
  }

  // Loads a <texture> both as a colour and as a scalar.
  Scene load(const std::string& texture) const {
    return load_scene(folder_.write(
        "scene.xml",
        R"(<scene version="3.0.0"><sensor type="perspective"/>)" + texture +
            R"(<bsdf type="roughconductor" id="m"><ref id="t" name="alpha"/><ref id="t" name="specular_reflectance"/></bsdf>
      <shape type="sphere"><ref id="m"/></shape></scene>)"));
  }

  void expect(const std::string& texture, std::span<const Sample> samples, bool scalar) const {
    const Scene scene = load(texture);
    const Material& m = scene.materials[1];
    for (const Sample& s : samples) {
      const Vec3f color =
          evaluate_texture(texture_view(scene.textures[static_cast<std::size_t>(m.specular_reflectance)]), s.uv);
      EXPECT_LT(length(color - s.color), 2e-5f)
          << s.uv.x << " " << s.uv.y << ": " << color.x << " " << color.y << " " << color.z;
      if (!scalar) continue;
      const Texture& t = scene.textures[static_cast<std::size_t>(m.alpha_u)];
      EXPECT_NEAR(evaluate_texture(texture_view(t), s.uv).x, s.scalar, 2e-5f);
      const Vec2f g = texture_gradient(texture_view(t), s.uv);
      EXPECT_NEAR(g.x, s.gradient.x, 3e-5f) << s.uv.x << " " << s.uv.y;
      EXPECT_NEAR(g.y, s.gradient.y, 3e-5f) << s.uv.x << " " << s.uv.y;
    }
  }

  static std::string bitmap(const std::string& file, const std::string& more = "") {
    return R"(<texture type="bitmap" id="t"><string name="filename" value=")" + file + R"("/>)" + more + "</texture>";
  }

  TestFolder folder_;
};

TEST_F(TextureTest, Linear) { expect(bitmap("t.exr"), k_linear, true); }
TEST_F(TextureTest, SrgbIsDecodedBeforeFiltering) { expect(bitmap("t.png"), k_srgb, true); }
TEST_F(TextureTest, Raw) { expect(bitmap("t.png", R"(<boolean name="raw" value="true"/>)"), k_raw, true); }
TEST_F(TextureTest, Grey) { expect(bitmap("g.png"), k_grey, true); }
TEST_F(TextureTest, Nearest) {
  expect(bitmap("t.exr", R"(<string name="filter_type" value="nearest"/>)"), k_nearest, true);
}
TEST_F(TextureTest, Mirror) { expect(bitmap("t.exr", R"(<string name="wrap_mode" value="mirror"/>)"), k_mirror, true); }
TEST_F(TextureTest, Clamp) { expect(bitmap("t.exr", R"(<string name="wrap_mode" value="clamp"/>)"), k_clamp, true); }
TEST_F(TextureTest, MirrorNearest) {
  expect(bitmap("t.exr", R"(<string name="wrap_mode" value="mirror"/><string name="filter_type" value="nearest"/>)"),
         k_mirror_nearest, true);
}
TEST_F(TextureTest, ToUv) {
  expect(bitmap("t.exr", R"(<transform name="to_uv"><scale x="2" y="3"/><rotate z="1" angle="30"/></transform>)"),
         k_rotated, false);
  expect(bitmap("t.exr", R"(<transform name="to_uv"><scale x="2" y="3"/></transform>)"), k_scaled, true);
  expect(bitmap("t.exr", R"(<transform name="to_uv"><rotate z="1" angle="30"/></transform>)"), k_turned, false);
}
TEST_F(TextureTest, Checkerboard) {
  expect(R"(<texture type="checkerboard" id="t"/>)", k_checker, false);
  expect(
      R"(<texture type="checkerboard" id="t"><rgb name="color0" value="0.1 0.2 0.3"/><float name="color1" value="0.9"/>
    <transform name="to_uv"><scale x="2" y="3"/></transform></texture>)",
      k_checker_scaled, false);
}

// Mitsuba 3.9.1: eval_1 at (0.25, 0.25) is color1.
TEST_F(TextureTest, CheckerboardOfNumbersIsExchanged) {
  const Scene scene = load(
      R"(<texture type="checkerboard" id="t"><float name="color0" value="0.8"/><float name="color1" value="0.2"/></texture>)");
  const Material& m = scene.materials[1];
  const auto at = [&](int texture, Vec2f uv) {
    return evaluate_texture(texture_view(scene.textures[static_cast<std::size_t>(texture)]), uv).x;
  };
  EXPECT_EQ(at(m.alpha_u, {0.25f, 0.25f}), 0.2f);
  EXPECT_EQ(at(m.alpha_u, {0.25f, 0.75f}), 0.8f);
  EXPECT_EQ(at(m.specular_reflectance, {0.25f, 0.25f}), 0.8f);
}

// Also where to_uv rotates and the picture is not square: there Mitsuba 3.9.1 multiplies by width and height after
// turning instead of before, and its eval_1_grad is not the derivative of its eval_1.
TEST_F(TextureTest, GradientIsTheDerivativeOfTheValue) {
  const Scene scene = load(
      bitmap("t.exr", R"(<transform name="to_uv"><matrix value="1.5 0.4 0.1  -0.3 0.8 0.2  0 0 1"/></transform>)"));
  const Texture& t = scene.textures[static_cast<std::size_t>(scene.materials[1].alpha_u)];
  const float h = 1e-3f;
  for (const Vec2f uv : {Vec2f{0.11f, 0.23f}, Vec2f{0.61f, 0.3f}, Vec2f{-0.4f, 1.7f}}) {
    const Vec2f g = texture_gradient(texture_view(t), uv);
    EXPECT_NEAR(g.x,
                (evaluate_texture(texture_view(t), {uv.x + h, uv.y}).x -
                 evaluate_texture(texture_view(t), {uv.x - h, uv.y}).x) /
                    (2 * h),
                2e-3f);
    EXPECT_NEAR(g.y,
                (evaluate_texture(texture_view(t), {uv.x, uv.y + h}).x -
                 evaluate_texture(texture_view(t), {uv.x, uv.y - h}).x) /
                    (2 * h),
                2e-3f);
  }
}

TEST_F(TextureTest, WildCoordinatesStayInside) {
  const Scene scene = load(bitmap("t.exr"));
  const Texture& t = scene.textures[static_cast<std::size_t>(scene.materials[1].specular_reflectance)];
  Vec3f lowest(INFINITY), highest(-INFINITY);
  for (const Vec3f& pixel : t.pixels) lowest = min(lowest, pixel), highest = max(highest, pixel);
  for (const float x : {1e20f, -1e20f, INFINITY, NAN, 3e8f}) {
    for (const Vec2f uv : {Vec2f{x, x}, Vec2f{x, 0.3f}, Vec2f{0.3f, x}}) {
      const Vec3f v = evaluate_texture(texture_view(t), uv);
      EXPECT_EQ(min(v, lowest), lowest) << x;
      EXPECT_EQ(max(v, highest), highest) << x;
    }
  }
}

TEST_F(TextureTest, BrokenPicturesAreRefused) {
  folder_.write("broken.png", "\x89PNG\r\n\x1a\n and then nothing");
  Image image(1, 1, {"R", "G", "B"});
  image.data = {1.0f, NAN, 2.0f};
  write_exr(folder_.file("nan.exr"), image);
  for (const std::string file : {"broken.png", "nan.exr"}) {
    try {
      load(bitmap(file));
      FAIL() << file;
    } catch (const InputError& error) {
      EXPECT_NE(std::string(error.what()).find("scene.xml:1:"), std::string::npos) << error.what();
      EXPECT_NE(std::string(error.what()).find(file), std::string::npos) << error.what();
    }
  }
}

TEST_F(TextureTest, OvershootOfFiltersIsClamped) {
  Image image(2, 1, {"R", "G", "B"});
  image.data = {1.04f, 0.5f, -0.03f, 1.0f, 0.0f, 0.25f};
  write_exr(folder_.file("lanczos.exr"), image);
  const Scene scene = load(bitmap("lanczos.exr"));
  const Texture& t = scene.textures.at(static_cast<std::size_t>(scene.materials[1].specular_reflectance));
  EXPECT_EQ(t.pixels[0], Vec3f(1.0f, 0.5f, 0.0f));
  EXPECT_EQ(t.pixels[1], Vec3f(1.0f, 0.0f, 0.25f));
  EXPECT_NE(join(scene.assumed).find("2 values a little below 0 or above 1, read as 0 and 1"), std::string::npos)
      << join(scene.assumed);
  image.data[2] = -0.06f;  // a colour of another gamut
  write_exr(folder_.file("lanczos.exr"), image);
  const Scene wide = load(bitmap("lanczos.exr"));
  EXPECT_EQ(wide.textures.at(static_cast<std::size_t>(wide.materials[1].specular_reflectance)).pixels[0].z, 0.0f);
  EXPECT_NE(join(wide.assumed).find("has 1 negative values, read as 0"), std::string::npos) << join(wide.assumed);
}

// Which conserve energy here; Mitsuba warns and keeps them.
TEST_F(TextureTest, BrightReflectancesAreClamped) {
  Image image(3, 1, {"R", "G", "B"});
  image.data = {3.5f, 0.5f, 0.25f, 1.0f, 0.0f, 0.25f, 1.25f, 1.5f, 1.02f};
  write_exr(folder_.file("hdr.exr"), image);
  const auto texture = [&](const std::string& name) {
    return "<texture type=\"bitmap\" id=\"t\" name=\"" + name +
           "\"><string name=\"filename\" value=\"hdr.exr\"/></texture>";
  };
  const auto load_body = [&](const std::string& body) {
    return load_scene(
        folder_.write("scene.xml", "<scene version=\"3.0.0\"><sensor type=\"perspective\"/>" + body + "</scene>"));
  };
  // The same picture as a light keeps its values.
  const Scene scene = load_body("<shape type=\"cube\"><emitter type=\"area\">" + texture("radiance") +
                                "</emitter><bsdf type=\"diffuse\"><ref id=\"t\" name=\"reflectance\"/></bsdf></shape>");
  const auto pixels = [&](int t) { return scene.textures.at(static_cast<std::size_t>(t)).pixels; };
  const std::vector<Vec3f> surface = pixels(scene.materials.at(1).reflectance),
                           light = pixels(scene.area_lights.at(0).radiance);
  EXPECT_EQ(surface.at(0), Vec3f(1.0f, 0.5f, 0.25f));
  EXPECT_EQ(surface.at(1), Vec3f(1.0f, 0.0f, 0.25f));
  EXPECT_EQ(surface.at(2), Vec3f(1.0f));
  EXPECT_EQ(light.at(0), Vec3f(3.5f, 0.5f, 0.25f));
  ASSERT_EQ(scene.assumed.size(), 1u) << join(scene.assumed, "\n");
  EXPECT_NE(scene.assumed[0].find("2 texels of reflectance above 1 (up to 3.5), read as 1"), std::string::npos)
      << scene.assumed[0];
  // What is no reflectance is refused as before.
  EXPECT_THROW(load_body("<bsdf type=\"mask\">" + texture("opacity") + "<bsdf type=\"diffuse\"/></bsdf>"), InputError);
}

TEST_F(TextureTest, GreyIsOfTheOnlyChannel) {
  const auto pixel = [&](const std::vector<std::string>& channels) {
    Image image(1, 1, channels);
    for (std::size_t c = 0; c < channels.size(); ++c) image.data[c] = 0.25f * static_cast<float>(c + 1);
    write_exr(folder_.file("grey.exr"), image);
    const Scene scene = load(bitmap("grey.exr"));
    return scene.textures.at(static_cast<std::size_t>(scene.materials[1].specular_reflectance)).pixels.at(0).x;
  };
  EXPECT_EQ(pixel({"V"}), 0.25f);
  EXPECT_EQ(pixel({"A", "depth.Z"}), 0.5f);
  EXPECT_EQ(pixel({"A", "Y"}), 0.5f);
  // Which of two layers of colours is meant cannot be told.
  try {
    pixel({"diffuse.R", "diffuse.G", "diffuse.B", "gloss.R", "gloss.G", "gloss.B"});
    FAIL();
  } catch (const InputError& error) {
    EXPECT_NE(std::string(error.what()).find("it has diffuse.R, diffuse.G"), std::string::npos) << error.what();
  }
}

}  // namespace
}  // namespace octrad
