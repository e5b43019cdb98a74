// Materials and textures of pbrt files, beside Mitsuba files that say the same.
#include "octrad/scene/pbrt/material.h"

#include <cmath>

#include "octrad/image/io.h"
#include "octrad/scene/pbrt/pbrt_test_helper.h"
#include "octrad/scene/texture.h"

namespace octrad {
namespace {

TEST_F(PbrtTest, DiffuseMaterials) {
  same_material("", two_sided("<bsdf type=\"diffuse\"/>"));
  same_material("Material \"diffuse\" \"rgb reflectance\" [.1 .2 .3]\n",
                two_sided("<bsdf type=\"diffuse\"><rgb name=\"reflectance\" value=\".1 .2 .3\"/></bsdf>"));
  same_material(
      "MakeNamedMaterial \"m\" \"string type\" \"diffuse\" \"spectrum reflectance\" [400 .3 800 .3]\nNamedMaterial "
      "\"m\"\n",
      two_sided("<bsdf type=\"diffuse\"><spectrum name=\"reflectance\" value=\"400:.3, 800:.3\"/></bsdf>"));
  same_material("Attribute \"material\" \"rgb reflectance\" [.1 .2 .3]\nMaterial \"diffuse\"\n",
                two_sided("<bsdf type=\"diffuse\"><rgb name=\"reflectance\" value=\".1 .2 .3\"/></bsdf>"));
  same_material("Material \"interface\"\n", "<bsdf type=\"null\"/>");
  same_material("Material \"matte\" \"color Kd\" [.1 .2 .3]\n",
                two_sided("<bsdf type=\"diffuse\"><rgb name=\"reflectance\" value=\".1 .2 .3\"/></bsdf>"), true);
  same_material(
      "Material \"diffusetransmission\" \"rgb reflectance\" [.1 .1 .1] \"rgb transmittance\" [.3 .3 .3]\n",
      "<bsdf type=\"principledthin\"><rgb name=\"base_color\" value=\".4\"/><float name=\"diff_trans\" value=\"1.5\"/>"
      "<float name=\"roughness\" value=\"1\"/></bsdf>");
}

TEST_F(PbrtTest, Coats) {
  const std::string tail =
      "<float name=\"int_ior\" value=\"1.5\"/><float name=\"ext_ior\" value=\"1\"/><boolean name=\"nonlinear\" "
      "value=\"true\"/>";
  same_material(
      "Material \"coateddiffuse\" \"rgb reflectance\" [.1 .2 .3]\n",
      two_sided("<bsdf type=\"plastic\"><rgb name=\"diffuse_reflectance\" value=\".1 .2 .3\"/>" + tail + "</bsdf>"));
  // Version 4: alpha is the root of the roughness.
  same_material("Material \"coateddiffuse\" \"float roughness\" .04\n",
                two_sided("<bsdf type=\"roughplastic\">" + tail +
                          "<string name=\"distribution\" value=\"ggx\"/><float name=\"alpha\" value=\".2\"/></bsdf>"));
  same_material("Material \"coateddiffuse\" \"float roughness\" .04 \"bool remaproughness\" false\n",
                two_sided("<bsdf type=\"roughplastic\">" + tail +
                          "<string name=\"distribution\" value=\"ggx\"/><float name=\"alpha\" value=\".04\"/></bsdf>"));
  // Version 3: a polynomial in its logarithm; 1.62142 at 1.
  const Scene old = load_old("Material \"plastic\" \"float roughness\" 1\n" + kPbrtSphere);
  EXPECT_NEAR(old.textures[static_cast<std::size_t>(old.materials[1].alpha_u)].color0.x, 1.62142f, 1e-5f);
  assumes(old, "read as coateddiffuse");
}

TEST_F(PbrtTest, Metals) {
  const std::string smooth = "<bsdf type=\"conductor\">";
  same_material("Material \"conductor\"\n", two_sided(smooth + "<string name=\"material\" value=\"Cu\"/></bsdf>"));
  same_material("Material \"conductor\" \"spectrum eta\" \"metal-Au-eta\" \"spectrum k\" \"metal-Au-k\"\n",
                two_sided(smooth + "<string name=\"material\" value=\"Au\"/></bsdf>"));
  // ((1 - 1)^2 + k^2) / ((1 + 1)^2 + k^2) = .5 for k = 2.
  same_material("Material \"conductor\" \"rgb reflectance\" [.5 .5 .5]\n",
                two_sided(smooth + "<rgb name=\"eta\" value=\"1\"/><rgb name=\"k\" value=\"2\"/></bsdf>"));
  same_material(
      "Material \"conductor\" \"rgb eta\" [1 2 3] \"rgb k\" [3 2 1] \"float uroughness\" .04 \"float vroughness\" .09\n",
      two_sided(
          "<bsdf type=\"roughconductor\"><string name=\"distribution\" value=\"ggx\"/><float name=\"alpha_u\" "
          "value=\".2\"/><float name=\"alpha_v\" value=\".3\"/><rgb name=\"eta\" value=\"1 2 3\"/><rgb name=\"k\" "
          "value=\"3 2 1\"/></bsdf>"));
  same_material("Material \"mirror\" \"rgb Kr\" [.9 .8 .7]\n",
                two_sided(smooth + "<string name=\"material\" value=\"none\"/><rgb name=\"specular_reflectance\" "
                                   "value=\".9 .8 .7\"/></bsdf>"),
                true);
  const Scene brass = load(
      "Material \"conductor\" \"spectrum eta\" \"metal-CuZn-eta\" \"spectrum k\" \"metal-CuZn-k\"\n" + kPbrtSphere);
  expect_near(Vec3d(brass.materials[1].eta), {.444, .527, 1.094});
  assumes(load("Material \"coatedconductor\"\n" + kPbrtSphere), "has no coat");
}

TEST_F(PbrtTest, Glass) {
  const auto glass = [](const char* type, const char* index, const char* more = "") {
    return std::string("<bsdf type=\"") + type + "\"><float name=\"int_ior\" value=\"" + index +
           "\"/><float name=\"ext_ior\" value=\"1\"/>" + more + "</bsdf>";
  };
  same_material("Material \"dielectric\"\n", glass("dielectric", "1.5"));
  same_material("Material \"dielectric\" \"spectrum eta\" \"glass-BK7\"\n", glass("dielectric", "1.5168"));
  same_material("Material \"thindielectric\" \"float eta\" 1.3\n", glass("thindielectric", "1.3"));
  same_material("Material \"dielectric\" \"float roughness\" .01\n",
                glass("roughdielectric", "1.5",
                      "<string name=\"distribution\" value=\"ggx\"/><float name=\"alpha\" value=\".1\"/>"));
  same_material("Material \"dielectric\" \"float eta\" 1\n", "<bsdf type=\"null\"/>");
  same_material(
      "Material \"glass\" \"rgb Kr\" [.1 .1 .1] \"rgb Kt\" [.2 .3 .4]\n",
      glass("dielectric", "1.5",
            "<rgb name=\"specular_reflectance\" value=\".1\"/><rgb name=\"specular_transmittance\" value=\".2 .3 "
            ".4\"/>"),
      true);
}

TEST_F(PbrtTest, MixesAndMasks) {
  const std::string red = "<bsdf type=\"diffuse\"><rgb name=\"reflectance\" value=\".5 .1 .1\"/></bsdf>",
                    blue = "<bsdf type=\"diffuse\"><rgb name=\"reflectance\" value=\".1 .1 .5\"/></bsdf>";
  const std::string both =
      "MakeNamedMaterial \"red\" \"string type\" \"diffuse\" \"rgb reflectance\" [.5 .1 .1]\n"
      "MakeNamedMaterial \"blue\" \"string type\" \"diffuse\" \"rgb reflectance\" [.1 .1 .5]\n";
  same_material(both + "Material \"mix\" \"string materials\" [\"red\" \"blue\"] \"float amount\" .3\n",
                two_sided("<bsdf type=\"blendbsdf\"><float name=\"weight\" value=\".3\"/>" + red + blue + "</bsdf>"));
  // In version 3 the amount is that of the first.
  same_material(
      both +
          "Material \"mix\" \"string namedmaterial1\" \"red\" \"string namedmaterial2\" \"blue\" \"rgb amount\" [.3 .3 .3]\n",
      two_sided("<bsdf type=\"blendbsdf\"><float name=\"weight\" value=\".3\"/>" + blue + red + "</bsdf>"), true);
  EXPECT_EQ(load("Material \"diffuse\"\nShape \"sphere\" \"float alpha\" .25\n").fingerprint,
            load_xml(on_sphere("<bsdf type=\"mask\"><float name=\"opacity\" value=\".25\"/>" +
                               two_sided("<bsdf type=\"diffuse\"/>") + "</bsdf>"))
                .fingerprint);
  fails(
      "WorldBegin\n" + both.substr(0, both.find('\n') + 1) +
          "MakeNamedMaterial \"b\" \"string type\" \"mix\" \"string materials\" [\"red\" \"b\"]\nNamedMaterial \"b\"\n" +
          kPbrtSphere,
      "3:1", "mixed too deep");
}

TEST_F(PbrtTest, MaterialsOfVersionThree) {
  const std::string open = "<bsdf type=\"principled\"><rgb name=\"base_color\" value=\"";
  const std::string tail =
      "\"/><float name=\"roughness\" value=\".5\"/><float name=\"eta\" value=\"1.5\"/><float name=\"spec_tint\" value=\"0\"/>"
      "<float name=\"anisotropic\" value=\"0\"/><float name=\"sheen\" value=\"0\"/><float name=\"sheen_tint\" value=\".5\"/>";
  const std::string rest =
      "<float name=\"metallic\" value=\"0\"/><float name=\"clearcoat\" value=\"0\"/><float "
      "name=\"clearcoat_gloss\" value=\"1\"/></bsdf>";
  same_material("Material \"disney\" \"float spectrans\" 0 \"rgb color\" [.1 .2 .3]\n",
                two_sided(open + ".1 .2 .3" + tail + "<float name=\"spec_trans\" value=\"0\"/>" + rest), true);
  same_material("Material \"disney\" \"float spectrans\" .5\n",
                open + ".5" + tail + "<float name=\"spec_trans\" value=\".5\"/>" + rest, true);
  const Scene thin = load_old("Material \"disney\" \"bool thin\" true\n" + kPbrtSphere);
  EXPECT_EQ(thin.materials[1].type, BsdfType::principledthin);
  EXPECT_FALSE(thin.materials[1].two_sided);
  // A quarter of Kd is reflected, three quarters are transmitted.
  same_material(
      "Material \"translucent\" \"rgb Kd\" [.4 .4 .4] \"rgb reflect\" [.25 .25 .25] \"rgb transmit\" [.75 .75 .75]\n",
      "<bsdf type=\"principledthin\"><rgb name=\"base_color\" value=\".4\"/><float name=\"diff_trans\" value=\"1.5\"/>"
      "<float name=\"roughness\" value=\"1\"/></bsdf>",
      true);
  same_material("Material \"plastic\" \"rgb Ks\" [0 0 0]\n",
                two_sided("<bsdf type=\"diffuse\"><rgb name=\"reflectance\" value=\".25\"/></bsdf>"), true);
  const Scene cut = load_old("Material \"uber\" \"rgb opacity\" [.5 .5 .5]\n" + kPbrtSphere);
  EXPECT_GE(cut.materials[1].opacity, 0);
  assumes(load_old("Material \"uber\" \"rgb Kt\" [.5 .5 .5]\n" + kPbrtSphere), "(Kr, Kt) is left out");
  // Opaque parts of a mix with holes have two sides.
  EXPECT_EQ(
      load(
          "MakeNamedMaterial \"a\" \"string type\" \"diffuse\"\nMakeNamedMaterial \"b\" \"string type\" \"interface\"\n"
          "Material \"mix\" \"string materials\" [\"a\" \"b\"] \"float amount\" .1\n" +
          kPbrtSphere)
          .fingerprint,
      load_xml(on_sphere("<bsdf type=\"blendbsdf\"><float name=\"weight\" value=\".1\"/>" +
                         two_sided("<bsdf type=\"diffuse\"/>") + "<bsdf type=\"null\"/></bsdf>"))
          .fingerprint);
}

TEST_F(PbrtTest, Maps) {
  Image picture(2, 2, {"R", "G", "B"});
  for (int i = 0; i < 4; ++i) picture.set_rgb(i % 2, i / 2, {0.5f, 0.5f, 1.0f});
  write_exr((folder_.path() / "n.exr").string(), picture);
  // Seen from behind the whole mapped normal is turned over: two sides within the map, not around it.
  const Material mapped = load("Material \"diffuse\" \"string normalmap\" \"n.exr\"\n" + kPbrtSquare).materials[1];
  EXPECT_TRUE(mapped.normal_map && mapped.two_sided && !mapped.bump_mirrored);
  const Scene bumps = load(
      "Texture \"h\" \"float\" \"imagemap\" \"string filename\" \"n.exr\"\nTexture \"s\" \"float\" "
      "\"scale\" \"texture tex\" \"h\" \"float scale\" .25\nMaterial \"diffuse\" \"texture displacement\" \"s\"\n" +
      kPbrtSquare);
  EXPECT_GE(bumps.materials[1].bump, 0);
  EXPECT_FALSE(bumps.materials[1].normal_map);
  EXPECT_TRUE(bumps.materials[1].two_sided && !bumps.materials[1].bump_mirrored);
  EXPECT_EQ(bumps.materials[1].bump_scale, 0.25f);
  // Without coordinates each triangle has (0, 0), (1, 0), (1, 1), of which v runs up.
  const Scene own = load(
      "Texture \"p\" \"spectrum\" \"imagemap\" \"string filename\" \"n.exr\"\nMaterial \"diffuse\" \"texture "
      "reflectance\" \"p\"\nShape \"trianglemesh\" \"point3 P\" [0 0 0 1 0 0 1 1 0]\n");
  ASSERT_EQ(own.meshes[0].uvs.size(), 3u);
  EXPECT_EQ(own.meshes[0].uvs[2], (Vec2f{1.0f, 0.0f}));
  EXPECT_EQ(own.meshes[0].uvs[0], (Vec2f{0.0f, 1.0f}));
  // A light that shines a picture.
  const Scene light =
      load("AreaLightSource \"diffuse\" \"string filename\" \"n.exr\" \"float scale\" 3\n" + kPbrtSquare);
  EXPECT_EQ(light.textures[static_cast<std::size_t>(light.area_lights[0].radiance)].pixels[0].z, 3.0f);
  fails("WorldBegin\nAreaLightSource \"diffuse\" \"string filename\" \"n.exr\" \"float power\" 3\n" + kPbrtSquare,
        "2:53", "a light with a picture");
  fails(
      "WorldBegin\nTexture \"p\" \"spectrum\" \"imagemap\" \"string filename\" \"n.exr\" \"string encoding\" \"gama 2\"\nMaterial "
      "\"diffuse\" \"texture reflectance\" \"p\"\n" +
          kPbrtSquare,
      "2:61", "the encoding is sRGB");
}

TEST_F(PbrtTest, Hair) {
  // d'Eon's concentrations, and the colour by Chiang's polynomial, whose value at a roughness of 0.3 is 5.87...
  const Scene plain = load("Material \"hair\"\n" + kPbrtSphere),
              grey = load("Material \"hair\" \"rgb reflectance\" [.5 .5 .5]\n" + kPbrtSphere);
  const auto absorption = [](const Scene& scene) {
    const Vec3f t = scene.textures[static_cast<std::size_t>(scene.materials[1].specular_transmittance)].color0;
    return Vec3d(-std::log(t.x), -std::log(t.y), -std::log(t.z));
  };
  expect_near(absorption(plain), Vec3d(.419, .697, 1.37) * 1.3, 1e-4);
  const double n = 0.3, power = 5.969 - 0.215 * n + 2.532 * n * n - 10.73 * n * n * n + 5.574 * n * n * n * n +
                                0.245 * n * n * n * n * n;
  expect_near(absorption(grey), Vec3d(std::pow(std::log(0.5) / power, 2.0)), 1e-4);
  EXPECT_NEAR(plain.materials[1].int_ior, 1.55f, 1e-6f);
}

TEST_F(PbrtTest, Textures) {
  Image picture(2, 1, {"R", "G", "B"});
  picture.set_rgb(0, 0, {0.2f, 0.4f, 0.6f});
  picture.set_rgb(1, 0, {0.5f, 0.5f, 0.5f});
  write_exr((folder_.path() / "p.exr").string(), picture);
  const std::string image =
      "Texture \"p\" \"spectrum\" \"imagemap\" \"string filename\" \"p.exr\" \"float uscale\" 2 "
      "\"float vscale\" 3 \"float udelta\" .5 \"float vdelta\" .25\n";
  const Scene plain = load(image + "Material \"diffuse\" \"texture reflectance\" \"p\"\n" + kPbrtSquare);
  const auto texture = [](const Scene& scene) -> const Texture& {
    return scene.textures[static_cast<std::size_t>(scene.materials[1].reflectance)];
  };
  EXPECT_EQ(texture(plain).pixels[0].y, 0.4f);
  // A corner at (s, t) = (1, 0) of pbrt, whose v runs up: (2.5, .25) of the picture from below.
  const TriangleMesh& mesh = plain.meshes[0];
  EXPECT_EQ(mesh.uvs[1].x, 1.0f);
  EXPECT_EQ(mesh.uvs[1].y, 1.0f);
  const float* m = texture(plain).to_uv;
  EXPECT_NEAR(m[0] * mesh.uvs[1].x + m[1] * mesh.uvs[1].y + m[2], 2.5f, 1e-6f);
  EXPECT_NEAR(m[3] * mesh.uvs[1].x + m[4] * mesh.uvs[1].y + m[5], 1.0f - 0.25f, 1e-6f);
  // Factors, inversion, products with constants.
  const Scene scaled = load(image +
                            "Texture \"s\" \"spectrum\" \"scale\" \"texture tex\" \"p\" \"float scale\" .5\n"
                            "Material \"diffuse\" \"texture reflectance\" \"s\"\n" +
                            kPbrtSquare);
  EXPECT_NEAR(texture(scaled).pixels[0].z, 0.3f, 1e-6f);
  const Scene inverted = load(
      "Texture \"p\" \"spectrum\" \"imagemap\" \"string filename\" \"p.exr\" \"bool invert\" true\n"
      "Material \"diffuse\" \"texture reflectance\" \"p\"\n" +
      kPbrtSquare);
  EXPECT_NEAR(texture(inverted).pixels[0].x, 0.8f, 1e-6f);
  // Of a roughness the fourth root is the roughness of principled; numbers are means of the channels.
  const Scene rough = load(
      "Texture \"r\" \"float\" \"imagemap\" \"string filename\" \"p.exr\"\n"
      "Material \"conductor\" \"texture roughness\" \"r\"\n" +
      kPbrtSquare);
  EXPECT_NEAR(rough.textures[static_cast<std::size_t>(rough.materials[1].alpha_u)].pixels[0].x, std::sqrt(0.4f), 1e-6f);
  const Scene coat = load(
      "Texture \"r\" \"float\" \"imagemap\" \"string filename\" \"p.exr\"\n"
      "Material \"coateddiffuse\" \"texture roughness\" \"r\"\n" +
      kPbrtSquare);
  assumes(coat, "read as principled");
  const auto roughness = static_cast<std::size_t>(coat.materials[1].extra[ExtraParameter::roughness]);
  EXPECT_NEAR(coat.textures[roughness].pixels[0].x, std::pow(0.4f, 0.25f), 1e-6f);
  // Products and mixes of pictures: of the larger size.
  Image small(1, 1, {"R", "G", "B"});
  small.set_rgb(0, 0, {0.5f, 0.25f, 1.0f});
  write_exr((folder_.path() / "q.exr").string(), small);
  const std::string pair =
      "Texture \"p\" \"spectrum\" \"imagemap\" \"string filename\" \"p.exr\"\nTexture \"q\" \"spectrum\" \"imagemap\" \"string filename\" \"q.exr\"\n";
  const std::string use = "Material \"diffuse\" \"texture reflectance\" \"r\"\n" + kPbrtSquare;
  const Scene product =
      load(pair + "Texture \"r\" \"spectrum\" \"scale\" \"texture tex1\" \"p\" \"texture tex2\" \"q\"\n" + use);
  EXPECT_EQ(texture(product).width, 2);
  expect_near(Vec3d(texture(product).pixels[0]), {.1, .1, .6}, 1e-6);
  const Scene mix = load(
      pair + "Texture \"r\" \"spectrum\" \"mix\" \"texture tex1\" \"p\" \"texture tex2\" \"q\" \"float amount\" .25\n" +
      use);
  expect_near(Vec3d(texture(mix).pixels[1]), {.5, .4375, .625}, 1e-6);
  fails(std::string("WorldBegin\n") + image + pair.substr(pair.find('\n') + 1) +
            "Texture \"r\" \"spectrum\" \"mix\" \"texture tex1\" \"p\" \"texture tex2\" \"q\"\n" + use,
        "4:1", "in two ways");
  // Constants are folded.
  const Scene folded = load(
      "Texture \"a\" \"spectrum\" \"constant\" \"rgb value\" [.2 .4 .6]\n"
      "Texture \"b\" \"spectrum\" \"mix\" \"texture tex1\" \"a\" \"rgb tex2\" [1 1 1] \"float amount\" .25\n"
      "Material \"diffuse\" \"texture reflectance\" \"b\"\n" +
      kPbrtSphere);
  expect_near(Vec3d(texture(folded).color0), {.4, .55, .7});
}

// Every field of a checkerboard, colours and numbers, against pbrt's rule: the parity of floor(s) + floor(t).
// Version 4: alpha where not all is opaque, else the mean of the colour. Version 3, and Mitsuba: luminance.
TEST_F(PbrtTest, NumbersOfPictures) {
  const auto number = [&](const std::string& file, bool old, const std::string& more = "") {
    const std::string body =
        "Texture \"r\" \"float\" \"imagemap\" \"string filename\" \"" + file + "\"" + more + "\nMaterial \"" +
        (old ? "metal\" \"texture roughness\" \"r\" \"bool remaproughness\" \"false\"" : "diffuse\"") +
        "\nShape \"trianglemesh\" \"point3 P\" [0 0 0 1 0 0 0 1 0] \"point2 uv\" [0 0 1 0 0 1] "
        "\"integer indices\" [0 1 2]" +
        (old ? "\n" : " \"texture alpha\" \"r\"\n");
    const Scene scene = old ? load_old(body) : load(body);
    for (const Material& m : scene.materials) {
      if (old && m.type == BsdfType::roughconductor)
        return scene.textures[static_cast<std::size_t>(m.alpha_u)].pixels.at(0).x;
      if (m.opacity >= 0) return scene.textures[static_cast<std::size_t>(m.opacity)].pixels.at(0).x;
    }
    return -1.0f;
  };
  Image picture(2, 1, {"R", "G", "B", "A"});
  for (int x = 0; x < 2; ++x) {
    picture.set_rgb(x, 0, {1, 0, 0});
    picture.at(x, 0, 3) = 1.0f;
  }
  write_exr((folder_.path() / "opaque.exr").string(), picture);
  picture.at(0, 0, 3) = 0.25f;
  write_exr((folder_.path() / "alpha.exr").string(), picture);
  EXPECT_NEAR(number("alpha.exr", false), 0.25f, 1e-6f);
  EXPECT_NEAR(number("opaque.exr", false), 1.0f / 3.0f, 1e-6f);
  EXPECT_NEAR(number("opaque.exr", false, " \"float scale\" .5"), 0.5f / 3.0f, 1e-6f);
  EXPECT_NEAR(number("alpha.exr", true), luminance(Vec3f(1, 0, 0)), 1e-6f);
  EXPECT_NEAR(number("alpha.exr", true, " \"float scale\" .5"), 0.5f * luminance(Vec3f(1, 0, 0)), 1e-6f);
}

TEST_F(PbrtTest, Checkerboards) {
  const Scene scene = load(
      "Texture \"c\" \"spectrum\" \"checkerboard\" \"float uscale\" 3 \"float vscale\" 5 \"float udelta\" .2 \"float "
      "vdelta\" .7 \"rgb tex1\" [.1 .1 .1] \"rgb tex2\" [.9 .9 .9]\n"
      "Texture \"d\" \"float\" \"checkerboard\" \"float tex1\" .04 \"float tex2\" .16\n"
      "Material \"diffuse\" \"texture reflectance\" \"c\"\n" +
      kPbrtSquare + "Material \"conductor\" \"texture roughness\" \"d\"\n" + kPbrtSquare);
  const auto value = [&](int texture, double s, double t) {
    const Texture& x = scene.textures[static_cast<std::size_t>(texture)];
    const auto u = static_cast<float>(s), v = static_cast<float>(1.0 - t);
    const float a = x.to_uv[0] * u + x.to_uv[1] * v + x.to_uv[2], b = x.to_uv[3] * u + x.to_uv[4] * v + x.to_uv[5];
    return (a - std::floor(a) > 0.5f) == (b - std::floor(b) > 0.5f) ? x.color0.x : x.color1.x;
  };
  int checked = 0;
  for (double s = 0.013; s < 2.0; s += 0.11) {
    for (double t = 0.017; t < 2.0; t += 0.13, ++checked) {
      const auto odd = [](double x, double y) { return (static_cast<int>(std::floor(x) + std::floor(y)) & 1) != 0; };
      EXPECT_EQ(value(scene.materials[1].reflectance, s, t), odd(3.0 * s + 0.2, 5.0 * t + 0.7) ? 0.9f : 0.1f)
          << s << " " << t;
      EXPECT_NEAR(value(scene.materials[2].alpha_u, s, t), odd(s, t) ? 0.4f : 0.2f, 1e-6f) << s << " " << t;
    }
  }
  EXPECT_GT(checked, 200);
}

// Of pictures and of checkerboards, where the fields and the pictures are in step.
TEST_F(PbrtTest, CheckerboardsOfTextures) {
  Image picture(4, 4, {"R", "G", "B"});
  for (int i = 0; i < 16; ++i) picture.set_rgb(i % 4, i / 4, {0.05f * static_cast<float>(i), 0.3f, 0.4f});
  write_exr((folder_.path() / "p.exr").string(), picture);
  const std::string image =
      "Texture \"p\" \"spectrum\" \"imagemap\" \"string filename\" \"p.exr\" \"float uscale\" 2 \"float udelta\" .125\n";
  const auto checks = [](const std::string& numbers, const std::string& parts, const std::string& name = "c") {
    return "Texture \"" + name + "\" \"spectrum\" \"checkerboard\" " + numbers + " " + parts + "\n";
  };
  const auto use = [](const std::string& name) {
    return "Material \"diffuse\" \"texture reflectance\" \"" + name + "\"\n" + kPbrtSquare;
  };
  const auto value = [](const Scene& scene, double s, double t) {
    return evaluate_texture(texture_view(scene.textures[static_cast<std::size_t>(scene.materials[1].reflectance)]),
                            {static_cast<float>(s), static_cast<float>(1.0 - t)});
  };
  const Scene plain = load(image + use("p"));
  // Fields for each picture: 3 and 3, 2.5 and 2.5, 4 and none.
  for (const auto& [fields_u, fields_v] : {std::pair(6.0, 3.0), std::pair(5.0, 2.5), std::pair(8.0, 0.0)}) {
    const std::string numbers = "\"float uscale\" " + std::to_string(fields_u) + " \"float vscale\" " +
                                std::to_string(fields_v) + " \"float udelta\" .4 \"float vdelta\" .3";
    const Scene scene = load(image + checks(numbers, "\"texture tex1\" \"p\" \"rgb tex2\" [.9 .8 .7]") + use("c"));
    int checked = 0;
    for (double s = 0.013; s < 2.0; s += 0.071) {
      for (double t = 0.017; t < 2.0; t += 0.083) {
        const double x = fields_u * s + 0.4, y = fields_v * t + 0.3;
        const auto inside = [](double f) { return f - std::floor(f) > 0.1 && f - std::floor(f) < 0.9; };
        if (!inside(x) || !inside(y)) continue;  // the edge of a field is as wide as a pixel
        ++checked;
        const bool odd = (static_cast<int>(std::floor(x) + std::floor(y)) & 1) != 0;
        expect_near(Vec3d(value(scene, s, t)), odd ? Vec3d(.9, .8, .7) : Vec3d(value(plain, s, t)), 0.05);
      }
    }
    EXPECT_GT(checked, 200);
  }
  // Of checkerboards, exactly; as the amount of a mix too.
  const std::string numbers = "\"float uscale\" 4 \"float vscale\" 4",
                    two = "\"rgb tex1\" [.1 .2 .3] \"rgb tex2\" [.5 .6 .7]";
  const Scene nested = load(checks(numbers, two, "d") + checks(numbers, "\"rgb tex1\" [1 1 1] \"texture tex2\" \"d\"") +
                            use("c")),
              flat = load(checks(numbers, "\"rgb tex1\" [1 1 1] \"rgb tex2\" [.5 .6 .7]") + use("c")),
              amount = load(
                  "Texture \"a\" \"float\" \"checkerboard\" " + numbers +
                  " \"float tex1\" 0 \"float tex2\" 1\nTexture \"c\" \"spectrum\" \"mix\" \"rgb tex1\" [1 1 1] \"rgb "
                  "tex2\" [.5 .6 .7] \"texture amount\" \"a\"\n" +
                  use("c"));
  EXPECT_EQ(nested.fingerprint, flat.fingerprint);
  EXPECT_EQ(amount.fingerprint, flat.fingerprint);
  const auto refused = [&](const std::string& text, const std::string& what) {
    const std::string message = error("WorldBegin\n" + text + use("c"));
    EXPECT_NE(message.find(what), std::string::npos) << message;
  };
  const std::string of_picture = "\"texture tex1\" \"p\" \"rgb tex2\" [.9 .8 .7]";
  refused(image + checks("\"float uscale\" 3.3", of_picture), "not in step");
  refused(image + checks("\"float uscale\" 1e9", of_picture), "not in step");
  // In one another they make a picture that holds the innermost ones more and more often.
  const std::string apart = "\"rgb tex2\" [.9 .8 .7] \"float udelta\" .4 \"float uscale\" ";
  refused(image + checks(apart + "1", "\"texture tex1\" \"p\"", "d") +
              checks(apart + ".25", "\"texture tex1\" \"d\"", "e") + checks(apart + ".0625", "\"texture tex1\" \"e\""),
          "not in step");
  refused(image + checks("\"float uscale\" 1e29", of_picture), "not in step");
  refused("Texture \"p\" \"spectrum\" \"imagemap\" \"string filename\" \"p.exr\" \"string wrap\" \"clamp\"\n" +
              checks("\"float uscale\" 4", of_picture),
          "do not repeat");
  refused("Texture \"p\" \"spectrum\" \"imagemap\" \"string filename\" \"p.exr\" \"float uscale\" 0\n" +
              checks("\"float uscale\" 4", of_picture),
          "not in step");
  refused(checks(numbers, two, "d") + checks("\"float uscale\" 3", "\"texture tex1\" \"d\""), "in two ways");
}

// Shares beyond [0, 1] are its ends; heights may be below 0, and one that cannot be read is left out.
TEST_F(PbrtTest, NumbersBeyondTheirRange) {
  const std::string sphere = "Material \"diffuse\"\nShape \"sphere\" \"float alpha\" ",
                    plain = "Material \"diffuse\"\n" + kPbrtSphere;
  EXPECT_EQ(load(sphere + "1.5\n").fingerprint, load(plain).fingerprint);
  EXPECT_EQ(load(sphere + "-1\n").fingerprint, load(sphere + "0\n").fingerprint);
  const std::string mix =
      "MakeNamedMaterial \"a\" \"string type\" \"diffuse\"\nMakeNamedMaterial \"b\" \"string type\" \"conductor\"\n"
      "Material \"mix\" \"string materials\" [\"a\" \"b\"] \"float amount\" ";
  EXPECT_EQ(load(mix + "1.5\n" + kPbrtSphere).fingerprint, load(mix + "1\n" + kPbrtSphere).fingerprint);
  Image picture(2, 1, {"Y"});
  picture.at(0, 0, 0) = 0.5f;
  picture.at(1, 0, 0) = -0.25f;
  write_exr((folder_.path() / "p.exr").string(), picture);
  const auto image = [](const char* scale) {
    return std::string(
               "Texture \"p\" \"float\" \"imagemap\" \"string filename\" \"p.exr\" \"string filter\" \"point\" \"float scale\" ") +
           scale + "\n";
  };
  const auto values = [](const Scene& scene, int texture) {
    const TextureView t = texture_view(scene.textures[static_cast<std::size_t>(texture)]);
    return std::pair(evaluate_texture(t, {0.25f, 0.5f}).x, evaluate_texture(t, {0.75f, 0.5f}).x);
  };
  const Scene cut = load(image("3") + "Material \"diffuse\"\nShape \"sphere\" \"texture alpha\" \"p\"\n");
  EXPECT_EQ(values(cut, cut.materials[1].opacity), std::pair(1.0f, 0.0f));
  const Scene high = load(image("-3") + "Material \"diffuse\" \"texture displacement\" \"p\"\n" + kPbrtSquare);
  EXPECT_EQ(values(high, high.materials[1].bump), std::pair(-1.5f, 0.75f));
  const Scene left =
      load("Texture \"w\" \"float\" \"wrinkled\"\nMaterial \"diffuse\" \"texture displacement\" \"w\"\n" + kPbrtSphere);
  assumes(left, "a displacement is left out");
  EXPECT_EQ(left.fingerprint, load(plain).fingerprint);
  // The encoding is that of formats that hold what a screen shows.
  const Scene linear = load(
      "Texture \"p\" \"float\" \"imagemap\" \"string filename\" \"p.exr\" \"string encoding\" \"gamma 2.2\"\n"
      "Material \"conductor\" \"texture roughness\" \"p\" \"bool remaproughness\" false\n" +
      kPbrtSquare);
  EXPECT_FLOAT_EQ(values(linear, linear.materials[1].alpha_u).first, 0.5f);
}

// Version 3 cuts out where alpha is 0 alone, and its spectra go on as they end.
TEST_F(PbrtTest, AlphaAndSpectraOfVersionThree) {
  const std::string plain = "Material \"matte\"\n" + kPbrtSphere,
                    sphere = "Material \"matte\"\nShape \"sphere\" \"float alpha\" ";
  EXPECT_EQ(load_old(sphere + ".25\n").fingerprint, load_old(plain).fingerprint);
  EXPECT_FLOAT_EQ(load_old(sphere + "0\n")
                      .textures.at(static_cast<std::size_t>(load_old(sphere + "0\n").materials[1].opacity))
                      .color0.x,
                  0.0f);
  const auto color = [this](const std::string& spectrum) {
    const Scene scene = load_old("Material \"matte\" \"spectrum Kd\" [" + spectrum + "]\n" + kPbrtSphere);
    return Vec3d(scene.textures.at(static_cast<std::size_t>(scene.materials[1].reflectance)).color0);
  };
  const Vec3d whole = color("300 .3 400 .6 410 .65 415 .8 500 .2 600 .1 900 .1");
  expect_near(color("300 .3 400 .6 410 .65 415 .8 500 .2 600 .1"), whole);
  expect_near(color("600 .1 500 .2 415 .8 410 .65 400 .6 300 .3"), whole);
  EXPECT_GT(whole.x, 0.09);
  fails("WorldBegin\nMaterial \"diffuse\" \"spectrum reflectance\" [600 .1 500 .2]\n" + kPbrtSphere, "2:20",
        "must increase");
}

}  // namespace
}  // namespace octrad
