// Materials of glTF files.
#include <cmath>

#include "octrad/base/join.h"
#include "octrad/image/tonemap_math.h"
#include "octrad/scene/gltf/gltf_test_helper.h"
#include "octrad/scene/gltf/specular_glossiness.h"

namespace octrad {
namespace {

TEST_F(GltfTest, MaterialFactorsAndTextures) {
  add_picture(255, 128, 64);
  json_["materials"] =
      Json::parse(R"([{"pbrMetallicRoughness": {"baseColorFactor": [0.5, 1, 0.25, 1], "metallicFactor": 0.5,
    "roughnessFactor": 0.5, "baseColorTexture": {"index": 0}, "metallicRoughnessTexture": {"index": 0}}, "doubleSided": true}])");
  Scene scene = load();
  const Material& m = material(scene);
  EXPECT_TRUE(m.two_sided);
  const Vec3f base = value(scene, m.reflectance);
  EXPECT_FLOAT_EQ(base.x, 0.5f);
  EXPECT_NEAR(base.y, 0.21586f, 1e-5f);  // 128 of sRGB
  EXPECT_NEAR(base.z, 0.25f * 0.05127f, 1e-5f);
  EXPECT_FLOAT_EQ(value(scene, m.extra[ExtraParameter::roughness]).x, 0.5f * 128 / 255);
  EXPECT_FLOAT_EQ(value(scene, m.extra[ExtraParameter::metallic]).x, 0.5f * 64 / 255);
  EXPECT_FLOAT_EQ(m.int_ior, 1.5f);

  json_["materials"][0].update(Json::parse(R"({"extensions": {"KHR_materials_ior": {"ior": 1.8},
    "KHR_materials_transmission": {"transmissionFactor": 0.75}, "KHR_materials_volume": {"thicknessFactor": 1}},
    "normalTexture": {"index": 0}})"));
  scene = load();
  const Material& glass = material(scene);
  EXPECT_FALSE(glass.two_sided);
  EXPECT_TRUE(glass.normal_map);
  EXPECT_FLOAT_EQ(glass.int_ior, 1.8f);
  EXPECT_FLOAT_EQ(value(scene, glass.extra[ExtraParameter::spec_trans]).x, 0.75f);
  EXPECT_EQ(value(scene, glass.bump), Vec3f(1.0f, 128.0f / 255, 64.0f / 255));
  json_["materials"][0]["extensions"].erase("KHR_materials_volume");
  EXPECT_EQ(material(load()).type, BsdfType::principledthin);

  json_["materials"] = Json::parse(R"([{"emissiveFactor": [0.5, 0, 1], "alphaMode": "BLEND",
    "pbrMetallicRoughness": {"baseColorFactor": [1, 1, 1, 0.25]},
    "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": 8},
      "KHR_materials_clearcoat": {"clearcoatFactor": 0.5}, "KHR_materials_specular": {"specularFactor": 0.25}}}])");
  scene = load();
  EXPECT_FLOAT_EQ(value(scene, material(scene).opacity).x, 0.25f);
  EXPECT_FLOAT_EQ(value(scene, material(scene).extra[ExtraParameter::clearcoat]).x, 0.5f);
  EXPECT_FLOAT_EQ(value(scene, material(scene).extra[ExtraParameter::clearcoat_gloss]).x, 1.0f);
  EXPECT_FLOAT_EQ(material(scene).int_ior, 1.1f / 0.9f);  // F0 = 0.01
  ASSERT_EQ(scene.area_lights.size(), 1u);
  EXPECT_EQ(value(scene, scene.area_lights[0].radiance), Vec3f(4, 0, 8));
  EXPECT_TRUE(scene.environments.empty());
  EXPECT_NE(join(scene.assumed).find("a light shines where its surface is cut out"), std::string::npos);
  json_["materials"][0]["alphaMode"] = "MASK";
  EXPECT_FLOAT_EQ(value(load(), material(load()).opacity).x, 0.0f);
}

// Once at the surface, by Beer's law over the thickness in the scene.
TEST_F(GltfTest, AbsorptionInGlass) {
  primitive()["material"] = 0;
  Json& material0 = (json_["materials"] = Json::array({Json::object()}))[0];
  material0["pbrMetallicRoughness"]["metallicFactor"] = 0;
  Json& extensions = material0["extensions"];
  extensions = Json::parse(R"({"KHR_materials_transmission": {"transmissionFactor": 1}, "KHR_materials_volume":
    {"thicknessFactor": 0.5, "attenuationDistance": 0.25, "attenuationColor": [1, 0.5, 0]}})");
  Json& volume = extensions["KHR_materials_volume"];
  const auto color = [&] {
    const Scene scene = load();
    const Vec3f c = value(scene, material(scene).reflectance);
    EXPECT_EQ(join(scene.assumed).find("what glass absorbs") != std::string::npos, c != Vec3f(1.0f));
    return c;
  };
  EXPECT_LT(length(color() - Vec3f(1, 0.25f, 0)), 1e-6f);
  EXPECT_EQ(material(load()).type, BsdfType::principled);
  // Of what does not pass nothing is absorbed.
  extensions["KHR_materials_transmission"]["transmissionFactor"] = 0.5;
  EXPECT_LT(length(color() - Vec3f(1, 0.625f, 0.5f)), 1e-6f);
  material0["pbrMetallicRoughness"]["metallicFactor"] = 1;
  EXPECT_EQ(color(), Vec3f(1.0f));
  material0["pbrMetallicRoughness"]["metallicFactor"] = 0;
  extensions["KHR_materials_transmission"]["transmissionFactor"] = 1;
  json_["nodes"][0]["scale"] = {2, 2, -2};
  EXPECT_LT(length(color() - Vec3f(1, 0.0625f, 0)), 1e-6f);
  json_["nodes"][0].erase("scale");
  // Distances without end, and what has no thickness.
  for (const double distance : {0.0, 1e300}) {
    volume["attenuationDistance"] = distance;
    volume["attenuationColor"] = {1, 0.5, 0.25};
    EXPECT_EQ(value(load(), material(load()).reflectance), Vec3f(1.0f)) << distance;
  }
  volume["attenuationDistance"] = nullptr;  // as JavaScript writes infinity
  EXPECT_EQ(color(), Vec3f(1.0f));
  volume["attenuationDistance"] = 1e-300;
  EXPECT_EQ(color(), Vec3f(1, 0, 0));
  volume["attenuationDistance"] = 1;
  volume["thicknessFactor"] = 0;
  EXPECT_EQ(color(), Vec3f(1.0f));
  EXPECT_EQ(material(load()).type, BsdfType::principledthin);
  volume["thicknessFactor"] = 1;
  extensions.erase("KHR_materials_transmission");
  EXPECT_EQ(color(), Vec3f(1.0f));
  volume["attenuationDistance"] = -1;
  EXPECT_NE(error().find("\"attenuationDistance\" must be a number from 0"), std::string::npos) << error();
}

TEST_F(GltfTest, IndexOfRefraction) {
  primitive()["material"] = 0;
  const auto eta = [&](double ior, double factor, double color) {
    json_["materials"] = {
        {{"extensions",
          {{"KHR_materials_ior", {{"ior", ior}}},
           {"KHR_materials_specular", {{"specularFactor", factor}, {"specularColorFactor", {color, color, color}}}}}}}};
    return material(load()).int_ior;
  };
  const auto most = static_cast<float>((1 + std::sqrt(0.9)) / (1 - std::sqrt(0.9)));  // F0 = 0.9
  // As "gltf-transform metalrough" writes it.
  EXPECT_NEAR(eta(1000, 1, 0.04), 1.5f, 2e-3f);
  EXPECT_NEAR(eta(1e9, 1, 0.04), 1.5f, 1e-6f);
  EXPECT_FLOAT_EQ(eta(1000, 1, 1), most);
  EXPECT_NE(join(load().assumed).find("KHR_materials_ior read as another"), std::string::npos);
  // 0: all is reflected, where nothing scales it.
  EXPECT_FLOAT_EQ(eta(0, 1, 1), most);
  EXPECT_FLOAT_EQ(eta(0, 0.5, 0.08), 1.5f);
  EXPECT_FLOAT_EQ(eta(0, 0.5, 50), (1 + std::sqrt(0.5f)) / (1 - std::sqrt(0.5f)));  // at most 1, then the factor
  EXPECT_FLOAT_EQ(eta(1.8, 1, 1), 1.8f);
  EXPECT_EQ(join(load().assumed).find("another index"), std::string::npos);
}

TEST_F(GltfTest, FactorsAboveOne) {
  primitive()["material"] = 0;
  json_["materials"] = Json::parse(R"([{"emissiveFactor": [4, 0, 0.5],
    "pbrMetallicRoughness": {"baseColorFactor": [2, 0.5, 0, 1.5]}, "alphaMode": "BLEND"}])");
  Scene scene = load();
  EXPECT_EQ(value(scene, scene.area_lights.at(0).radiance), Vec3f(4, 0, 0.5f));
  EXPECT_EQ(value(scene, material(scene).reflectance), Vec3f(1, 0.5f, 0));
  EXPECT_LT(material(scene).opacity, 0);
  const std::string notes = join(scene.assumed);
  EXPECT_NE(notes.find("emissiveFactor above 1"), std::string::npos) << notes;
  EXPECT_NE(notes.find("baseColorFactor above 1"), std::string::npos) << notes;
  // Rounding is no news.
  json_["materials"] = Json::parse(R"([{"emissiveFactor": [1.0000001, 1, 1],
    "pbrMetallicRoughness": {"baseColorFactor": [1.0000001, 1, 1, 1]}}])");
  EXPECT_EQ(join(load().assumed).find("above 1"), std::string::npos);
  json_["materials"] = Json::parse(R"([{"emissiveFactor": [1e12, 1e12, 1e12],
    "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": 1e12}}}])");
  scene = load();
  EXPECT_FLOAT_EQ(value(scene, scene.area_lights.at(0).radiance).x, 1e24f);
  for (const double bad : {-0.5, 1e13}) {
    json_["materials"] = {{{"emissiveFactor", {bad, 0, 0}}}};
    EXPECT_NE(error().find("\"emissiveFactor\" must be a list of 3 numbers from 0"), std::string::npos) << bad;
    json_["materials"] = {{{"pbrMetallicRoughness", {{"baseColorFactor", {0, bad, 0, 1}}}}}};
    EXPECT_NE(error().find("\"baseColorFactor\" must be a list of 4 numbers from 0"), std::string::npos) << bad;
  }
}

// Textures with a factor of 0 keep neither colours of vertices away, nor their own coordinates apart from others'.
TEST_F(GltfTest, TexturesWithoutEffect) {
  add_picture(255, 128, 64);
  json_["materials"] = Json::parse(R"([{"emissiveTexture": {"index": 0, "texCoord": 1},
    "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}, "metallicFactor": 0, "roughnessFactor": 0,
      "metallicRoughnessTexture": {"index": 0, "texCoord": 2}},
    "extensions": {"KHR_materials_transmission": {"transmissionTexture": {"index": 0, "texCoord": 3}},
      "KHR_materials_clearcoat": {"clearcoatFactor": 0, "clearcoatTexture": {"index": 0, "texCoord": 4}}}}])");
  EXPECT_EQ(error(), "");
  Json& m = json_["materials"][0];
  m["pbrMetallicRoughness"].erase("baseColorTexture");
  primitive()["attributes"]["COLOR_0"] = add("VEC3", 5126, 3, gltf_bytes<float>({0.5f, 1, 0, 0.5f, 1, 0, 0.5f, 1, 0}));
  const Scene scene = load();
  EXPECT_EQ(value(scene, material(scene).reflectance), Vec3f(0.5f, 1, 0));
  EXPECT_EQ(join(scene.assumed).find("where there is a texture"), std::string::npos);
  // Each counts where it has an effect.
  primitive()["attributes"].erase("COLOR_0");
  m["pbrMetallicRoughness"]["baseColorTexture"] = {{"index", 0}};
  const Json plain = m;
  for (const char* change : {R"({"emissiveFactor": [0, 0, 1]})", R"({"pbrMetallicRoughness": {"metallicFactor": 1}})",
                             R"({"pbrMetallicRoughness": {"roughnessFactor": 0.5}})",
                             R"({"extensions": {"KHR_materials_transmission": {"transmissionFactor": 1}}})",
                             R"({"extensions": {"KHR_materials_clearcoat": {"clearcoatFactor": 1}}})"}) {
    m = plain;
    m.merge_patch(Json::parse(change));
    EXPECT_NE(error().find("two sets of texture coordinates"), std::string::npos) << change;
  }
  // Two names of one set.
  m = plain;
  m.merge_patch(Json::parse(R"({"pbrMetallicRoughness": {"metallicFactor": 1}})"));
  primitive()["attributes"]["TEXCOORD_2"] = primitive()["attributes"]["TEXCOORD_0"];
  EXPECT_EQ(error(), "");
}

TEST_F(GltfTest, TextureTransformSamplerAndMirroredNormalMaps) {
  add_picture(255, 128, 64);
  json_["samplers"] = {{{"wrapS", 33071}, {"wrapT", 33071}, {"magFilter", 9728}}};
  json_["textures"][0]["sampler"] = 0;
  // The lower left quarter, turned: the example of KHR_texture_transform.
  json_["materials"] = Json::parse(R"([{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0, "extensions":
    {"KHR_texture_transform": {"offset": [0, 1], "rotation": 1.5707963267948966, "scale": [0.5, 0.5]}}}}}])");
  Scene scene = load();
  const Texture& t = scene.textures[static_cast<std::size_t>(material(scene).reflectance)];
  EXPECT_EQ(t.wrap, Texture::Wrap::clamp);
  EXPECT_EQ(t.filter, Texture::Filter::nearest);
  const Vec2f corner = transform_uv(t, {1, 1}), left = transform_uv(t, {1, 0});
  EXPECT_NEAR(corner.x, 0.5f, 1e-6f);
  EXPECT_NEAR(corner.y, 0.5f, 1e-6f);
  EXPECT_NEAR(left.x, 0.0f, 1e-6f);
  EXPECT_NEAR(left.y, 0.5f, 1e-6f);

  // Two triangles, the second with its texture mirrored.
  primitive()["attributes"]["POSITION"] =
      add("VEC3", 5126, 6, gltf_bytes<float>({0, 0, 0, 1, 0, 0, 0, 1, 0, 2, 0, 0, 3, 0, 0, 2, 1, 0}));
  primitive()["attributes"]["TEXCOORD_0"] =
      add("VEC2", 5126, 6, gltf_bytes<float>({0, 1, 1, 1, 0, 0, 1, 1, 0, 1, 1, 0}));
  json_["materials"] = Json::parse(R"([{"normalTexture": {"index": 0, "scale": 0.5,
    "extensions": {"KHR_texture_transform": {"scale": [1, -1]}}}}])");
  EXPECT_NE(join(load().assumed).find("does not turn or mirror its slopes"), std::string::npos);
  json_["materials"] = Json::parse(R"([{"normalTexture": {"index": 0, "scale": 0.5}}])");
  scene = load();
  ASSERT_EQ(scene.shapes.size(), 2u);
  const auto normal = [&](std::size_t shape) {
    const Material& m = scene.materials[static_cast<std::size_t>(scene.shapes[shape].material)];
    return value(scene, m.bump) * 2.0f - Vec3f(1.0f);
  };
  const Vec3f expected = normalize(Vec3f(0.5f, 0.5f * (256.0f / 255 - 1), 128.0f / 255 - 1));
  EXPECT_LT(length(normal(0) - expected), 1e-5f);
  const Vec3f mirrored(expected.x, -expected.y, expected.z);
  EXPECT_LT(length(normal(1) - mirrored), 1e-5f);

  // A node that mirrors exchanges the two.
  json_["nodes"][0]["scale"] = {-1, 1, 1};
  scene = load();
  EXPECT_LT(length(normal(0) - mirrored), 1e-5f);
  EXPECT_LT(length(normal(1) - expected), 1e-5f);
  // In several places: groups of both kinds.
  json_["nodes"] = Json::parse(
      R"([{"mesh": 0}, {"mesh": 0, "translation": [0, 0, 1]}, {"mesh": 0, "scale": [-1, 1, 1]}, {"mesh": 0, "scale": [1, 1, -2]}])");
  json_["scenes"][0]["nodes"] = {0, 1, 2, 3};
  scene = load();
  ASSERT_EQ(scene.shapes.size(), 8u);
  int mirrors = 0;
  for (std::size_t i = 0; i < 8; ++i) {
    const bool mirrors_shape = scene.placements.at(static_cast<std::size_t>(scene.shapes[i].placement)).mirrors;
    const float x = scene.meshes[static_cast<std::size_t>(scene.shapes[i].geometry)].positions[1].x;  // 3: the second
    EXPECT_LT(length(normal(i) - (mirrors_shape == (x > 1.5f) ? expected : mirrored)), 1e-5f) << i;
    mirrors += mirrors_shape ? 1 : 0;
  }
  EXPECT_EQ(mirrors, 4);
}

// Seen from behind the whole mapped normal is turned over: two sides within the map, not around it.
TEST_F(GltfTest, NormalMapsOfTwoSides) {
  add_picture(200, 160, 230);
  json_["materials"] = Json::parse(R"([{"normalTexture": {"index": 0}, "doubleSided": true}])");
  const Scene scene = load();
  EXPECT_TRUE(material(scene).normal_map && material(scene).two_sided);
  EXPECT_FALSE(material(scene).bump_mirrored);
}

TEST_F(GltfTest, TangentsThatLeadElsewhere) {
  add_picture(200, 160, 230);
  json_["materials"] = Json::parse(R"([{"normalTexture": {"index": 0}}])");
  const auto noted = [&](std::initializer_list<float> tangents) {
    primitive()["attributes"]["TANGENT"] = add("VEC4", 5126, 3, gltf_bytes(tangents));
    return join(load().assumed).find("tangents differ on 100 %") != std::string::npos;
  };
  EXPECT_FALSE(noted({1, 0, 0, 1, 1, 0, 0, 1, 1, 0, 0, 1}));
  EXPECT_FALSE(noted({.8f, .6f, 0, 1, .8f, .6f, 0, 1, 1, 0, 0, 1}));
  EXPECT_TRUE(noted({0, 1, 0, 1, 0, 1, 0, 1, 0, 1, 0, 1}));
  EXPECT_TRUE(noted({1, 0, 0, -1, 1, 0, 0, -1, 1, 0, 0, -1}));
  EXPECT_FALSE(noted({std::nanf(""), 0, 0, 1, 1, 0, 0, 1, 1, 0, 0, 1}));  // some writers' where there is no area
  // Mirrored coordinates have tangents to the left.
  primitive()["attributes"]["TEXCOORD_0"] = add("VEC2", 5126, 3, gltf_bytes<float>({1, 1, 0, 1, 1, 0}));
  EXPECT_TRUE(noted({1, 0, 0, 1, 1, 0, 0, 1, 1, 0, 0, 1}));
  EXPECT_FALSE(noted({-1, 0, 0, -1, -1, 0, 0, -1, -1, 0, 0, -1}));
}

TEST_F(GltfTest, ColoursOfVertices) {
  const auto set = [&](std::initializer_list<std::uint8_t> colors) {
    primitive()["attributes"]["COLOR_0"] = add("VEC4", 5121, 3, gltf_bytes(colors), {{"normalized", true}});
  };
  set({255, 0, 0, 9, 255, 0, 0, 9, 0, 0, 0, 9});
  primitive()["material"] = 0;
  json_["materials"] = Json::parse(R"([{"pbrMetallicRoughness": {"baseColorFactor": [0.5, 1, 1, 1]}}])");
  const Scene scene = load();
  const Texture& t = scene.textures[static_cast<std::size_t>(material(scene).reflectance)];
  const auto at = [&](std::size_t vertex) {
    return evaluate_texture(texture_view(t), transform_uv(t, scene.meshes[0].uvs[vertex]));
  };
  EXPECT_LT(length(at(0) - Vec3f(0.5f, 0, 0)), 1e-5f);
  EXPECT_LT(length(at(2) - Vec3f(0, 0, 0)), 1e-5f);
  const auto notes_alpha = [&] {
    return join(load().assumed).find("no alpha from the colours of vertices") != std::string::npos;
  };
  EXPECT_FALSE(notes_alpha());
  for (const char* mode : {"MASK", "BLEND"}) {
    json_["materials"][0]["alphaMode"] = mode;
    EXPECT_TRUE(notes_alpha()) << mode;
  }
  // Beside a texture they are left out, with a note; one colour of all vertices is not, nor is its alpha.
  add_picture(255, 255, 255);
  json_["materials"][0]["normalTexture"] = {{"index", 0}};
  const auto left_out = [&] { return join(load().assumed).find("that differ are left out") != std::string::npos; };
  EXPECT_TRUE(left_out());
  set({51, 255, 0, 102, 51, 255, 0, 102, 51, 255, 0, 102});
  for (const bool textured : {false, true}) {
    if (textured) json_["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"] = {{"index", 0}};
    EXPECT_FALSE(left_out());
    EXPECT_FALSE(notes_alpha());
    const Scene one = load();
    EXPECT_LT(length(value(one, material(one).reflectance) - Vec3f(0.1f, 1, 0)), 1e-6f);
    EXPECT_FLOAT_EQ(value(one, material(one).opacity).x, 0.4f);
    EXPECT_TRUE(material(one).normal_map);
  }
  // Two meshes of one material, each with its own colour; vertices that no triangle has count for nothing.
  json_["materials"][0].erase("alphaMode");
  json_["meshes"][0]["primitives"].push_back(primitive());
  json_["meshes"][0]["primitives"][1]["attributes"]["COLOR_0"] =
      add("VEC3", 5126, 3, gltf_bytes<float>({1, 1, 2, 1, 1, 1, 1, 1, 1}));
  const Scene two = load();
  ASSERT_EQ(two.shapes.size(), 2u);
  EXPECT_NE(two.shapes[0].material, two.shapes[1].material);
  EXPECT_EQ(value(two, two.materials[static_cast<std::size_t>(two.shapes[1].material)].reflectance), Vec3f(0.5f, 1, 1));
  json_["meshes"][0]["primitives"].erase(1);
  primitive() = {{"attributes",
                  {{"POSITION", add("VEC3", 5126, 4, gltf_bytes<float>({0, 0, 0, 1, 0, 0, 0, 1, 0, 9, 9, 9}))},
                   {"COLOR_0", add("VEC3", 5126, 4, gltf_bytes<float>({0, 1, 0, 0, 1, 0, 0, 1, 0, 1, 1, 1}))}}},
                 {"indices", add("SCALAR", 5121, 3, gltf_bytes<std::uint8_t>({0, 1, 2}))},
                 {"material", 0}};
  const Scene unused = load();
  EXPECT_EQ(value(unused, material(unused).reflectance), Vec3f(0, 1, 0));
}

// Light from all sides is added where nothing in the file is meant to light it.
TEST_F(GltfTest, LampsAndTexturesThatShine) {
  add_picture(255, 128, 64);
  const auto sky = [&](const char* material) {
    json_["materials"] = Json::array({Json::parse(material)});
    const Scene scene = load();
    EXPECT_EQ(scene.area_lights.size(), std::string(material).find("emissiveFactor") != std::string::npos ? 1u : 0u);
    const std::string notes = join(scene.assumed);
    EXPECT_EQ(notes.find("keep it away") != std::string::npos, scene.environments.size() == 1) << notes;
    EXPECT_EQ(notes.find("because a lamp lights the scene") != std::string::npos, scene.environments.empty()) << notes;
    return scene.environments.size() == 1;
  };
  EXPECT_TRUE(sky(R"({})"));
  EXPECT_TRUE(sky(R"({"emissiveTexture": {"index": 0}})"));  // of black
  EXPECT_TRUE(sky(R"({"emissiveFactor": [1, 1, 1], "emissiveTexture": {"index": 0}})"));
  EXPECT_TRUE(sky(R"({"emissiveFactor": [1.00001, 1, 1], "emissiveTexture": {"index": 0}})"));  // rounded
  EXPECT_TRUE(sky(R"({"emissiveFactor": [0.1, 0, 0]})"));  // a signal lamp of a device
  EXPECT_FALSE(sky(R"({"emissiveFactor": [0.5, 0, 0]})"));
  EXPECT_FALSE(sky(R"({"emissiveFactor": [2, 1, 1], "emissiveTexture": {"index": 0}})"));
  const char* bright = R"({"emissiveFactor": [1, 1, 1], "emissiveTexture": {"index": 0},
    "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": 5}}})";
  EXPECT_FALSE(sky(bright));
  // Punctual lights keep it away whatever shines.
  json_["nodes"][0]["extensions"] = Json::parse(R"({"KHR_lights_punctual": {"light": 0}})");
  json_["extensions"] = Json::parse(R"({"KHR_lights_punctual": {"lights": [{"type": "point", "intensity": 0}]}})");
  for (const char* material : {R"({})", R"({"emissiveFactor": [1, 1, 1], "emissiveTexture": {"index": 0}})", bright}) {
    json_["materials"] = Json::array({Json::parse(material)});
    const Scene scene = load();
    EXPECT_TRUE(scene.environments.empty());
    EXPECT_EQ(join(scene.assumed).find("from all sides"), std::string::npos);
  }
}

TEST_F(GltfTest, Unlit) {
  json_["extensionsRequired"] = {"KHR_materials_unlit"};
  add_picture(255, 128, 64);
  json_["materials"] = Json::parse(R"([{"extensions": {"KHR_materials_unlit": {}}, "emissiveFactor": [9, 9, 9],
    "normalTexture": {"index": 0, "texCoord": 1}, "pbrMetallicRoughness": {"baseColorFactor": [0.5, 1, 0.25, 1]}}])");
  Json& m = json_["materials"][0];
  const auto radiance = [&](const Scene& scene) { return value(scene, scene.area_lights.at(0).radiance); };
  Scene scene = load();
  EXPECT_EQ(radiance(scene), Vec3f(0.5f, 1, 0.25f));
  EXPECT_EQ(material(scene).type, BsdfType::diffuse);
  EXPECT_EQ(value(scene, material(scene).reflectance), Vec3f(0.0f));
  EXPECT_EQ(scene.environments.size(), 1u);  // it is no lamp
  EXPECT_NE(join(scene.assumed).find("emits its base colour"), std::string::npos);
  m["pbrMetallicRoughness"]["baseColorTexture"] = {{"index", 0}};
  const Vec3f textured(0.5f, static_cast<float>(decode_srgb(128 / 255.0)),
                       static_cast<float>(0.25 * decode_srgb(64 / 255.0)));
  EXPECT_LT(length(radiance(load()) - textured), 1e-6f);
  // Nothing is emitted where the surface is cut out.
  Image8 picture(1, 1, 4);
  picture.data = {255, 128, 64, 153};
  write_image(folder_.file("a b.png"), picture);
  m["alphaMode"] = "BLEND";
  scene = load();
  EXPECT_LT(length(radiance(scene) - textured * 0.6f), 1e-6f);
  EXPECT_FLOAT_EQ(value(scene, material(scene).opacity).x, 0.6f);
  m["alphaMode"] = "MASK";
  EXPECT_LT(length(radiance(load()) - textured), 1e-6f);
  m["alphaCutoff"] = 0.7;
  EXPECT_EQ(radiance(load()), Vec3f(0.0f));
  // By the colours of vertices.
  m["pbrMetallicRoughness"].erase("baseColorTexture");
  m["alphaMode"] = "BLEND";
  m["pbrMetallicRoughness"]["baseColorFactor"] = {1, 1, 1, 0.5};
  primitive()["attributes"]["COLOR_0"] = add("VEC3", 5126, 3, gltf_bytes<float>({1, 0, 0, 1, 0, 0, 0, 1, 0}));
  scene = load();
  const Texture& t = scene.textures[static_cast<std::size_t>(scene.area_lights.at(0).radiance)];
  EXPECT_LT(length(evaluate_texture(texture_view(t), transform_uv(t, scene.meshes[0].uvs[2])) - Vec3f(0, 0.5f, 0)),
            1e-5f);
  // Black is no light.
  m["pbrMetallicRoughness"]["baseColorFactor"] = {0, 0, 0, 1};
  EXPECT_TRUE(load().area_lights.empty());
}

// Lamps of open meshes shine from both sides where their material has two; the front is on the side of the normal.
TEST_F(GltfTest, LampsOfTwoSides) {
  primitive()["material"] = 0;
  json_["materials"] = Json::parse(R"([{"emissiveFactor": [1, 1, 1], "doubleSided": true}])");
  const auto notes_front = [&] { return join(load().assumed).find("from its front only") != std::string::npos; };
  for (const char* node : {R"({"mesh": 0})", R"({"mesh": 0, "scale": [1, 1, -1]})"}) {
    json_["nodes"][0] = Json::parse(node);
    for (const float normal : {0.0f, 1.0f, -1.0f}) {
      if (normal != 0.0f) {
        primitive()["attributes"]["NORMAL"] =
            add("VEC3", 5126, 3, gltf_bytes<float>({0, 0, normal, 0, 0, normal, 0, 0, normal}));
      }
      const Scene scene = load();
      ASSERT_EQ(scene.area_lights.size(), 2u);
      float sides = 0.0f;
      for (const TriangleMesh& mesh : scene.meshes) {
        const Vec3f* p = mesh.positions.data();
        const Vec3i& t = mesh.triangles[0];
        const float front = mesh.normals.empty() ? cross(p[t[1]] - p[t[0]], p[t[2]] - p[t[0]]).z : mesh.normals[0].z;
        EXPECT_GT(front * (mesh.flip_normals ? -1.0f : 1.0f) * p[0].z, 0.0f) << node << normal;
        EXPECT_LT(std::fabs(p[0].z), 2e-4f);
        sides += p[0].z;
      }
      EXPECT_EQ(sides, 0.0f);
    }
    primitive()["attributes"].erase("NORMAL");
  }
  EXPECT_FALSE(notes_front());
  // Not of a half-transparent surface, nor of a glowing part.
  json_["materials"][0]["alphaMode"] = "BLEND";
  EXPECT_EQ(load().area_lights.size(), 1u);
  EXPECT_TRUE(notes_front());
  json_["materials"][0].erase("alphaMode");
  add_picture(255, 128, 64);
  json_["materials"][0]["emissiveTexture"] = {{"index", 0}};
  EXPECT_EQ(load().area_lights.size(), 1u);
  json_["materials"][0].erase("emissiveTexture");
  // Nor where no back is seen: a tetrahedron, here with vertices for each face, and without one of them.
  const std::vector<float> corner[4] = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  for (const bool closed : {true, false}) {
    std::vector<float> positions;
    for (const int i : {0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3})
      positions.insert(positions.end(), corner[i].begin(), corner[i].end());
    if (!closed) positions.resize(27);
    const std::string bytes(reinterpret_cast<const char*>(positions.data()), positions.size() * sizeof(float));
    primitive()["attributes"] = {{"POSITION", add("VEC3", 5126, static_cast<int>(positions.size() / 3), bytes)}};
    EXPECT_EQ(load().area_lights.size(), closed ? 1u : 2u);
  }
}

TEST_F(GltfTest, AnisotropyAndDiffuseTransmission) {
  primitive()["material"] = 0;
  json_["materials"] = Json::parse(R"([{"pbrMetallicRoughness": {"roughnessFactor": 0.4},
    "extensions": {"KHR_materials_anisotropy": {"anisotropyStrength": 0.5}}}])");
  Json& extensions = json_["materials"][0]["extensions"];
  const auto extra = [](const Scene& scene, int parameter) {
    return static_cast<double>(value(scene, material(scene).extra[parameter]).x);
  };
  Scene scene = load();
  // As principled makes alpha of them: r^2 over and times sqrt(1 - .9 a).
  const double r2 = std::pow(extra(scene, ExtraParameter::roughness), 2),
               aspect = std::sqrt(1.0 - 0.9 * extra(scene, ExtraParameter::anisotropic));
  EXPECT_NEAR(r2 / aspect, 0.16 + 0.84 * 0.25, 1e-5);
  EXPECT_NEAR(r2 * aspect, 0.16, 1e-5);
  extensions["KHR_materials_anisotropy"]["anisotropyRotation"] = 1.0;
  scene = load();
  EXPECT_NE(join(scene.assumed).find("KHR_materials_anisotropy with a"), std::string::npos);
  EXPECT_NEAR(extra(scene, ExtraParameter::roughness), 0.4, 1e-6);
  extensions = Json::parse(R"({"KHR_materials_diffuse_transmission": {"diffuseTransmissionFactor": 0.8}})");
  json_["extensionsRequired"] = {"KHR_materials_diffuse_transmission"};
  scene = load();
  EXPECT_EQ(material(scene).type, BsdfType::principledthin);
  EXPECT_NEAR(extra(scene, ExtraParameter::diff_trans), 1.6, 1e-6);
}

// Grey surfaces scatter as before, both diffusely and straight on; coloured ones are metals, or not.
TEST(GltfSpecularGlossiness, Formula) {
  for (const double diffuse : {0.0, 0.2, 0.7, 1.0}) {
    for (const double specular : {0.04, 0.05, 0.2, 0.5, 0.9}) {
      const GltfMetal metal = metal_of_specular(Vec3d(diffuse), Vec3d(specular));
      const double m = metal.metallic, base = metal.base.y;
      EXPECT_GE(m, 0.0);
      EXPECT_LE(m, 1.0);
      EXPECT_NEAR(base * (1.0 - m) * 0.96, diffuse * (1.0 - specular), 1e-5) << diffuse << " " << specular;
      EXPECT_NEAR(0.04 * (1.0 - m) + base * m, specular, 1e-5) << diffuse << " " << specular;
    }
    EXPECT_EQ(metal_of_specular(Vec3d(diffuse), Vec3d(0.01)).metallic, 0.0);
    EXPECT_NEAR(metal_of_specular(Vec3d(diffuse), Vec3d(1.0)).metallic, 1.0, 1e-12);
  }
  const Vec3d gold(1.0, 0.76, 0.33);
  const GltfMetal metal = metal_of_specular(Vec3d(0.0), gold);
  EXPECT_GT(metal.metallic, 0.999);
  EXPECT_LT(length(metal.base - gold), 1e-3);
  EXPECT_EQ(metal_of_specular(Vec3d(0.0), Vec3d(0.0)).base, Vec3d(0.0));
}

TEST_F(GltfTest, SpecularGlossiness) {
  json_["extensionsRequired"] = {"KHR_materials_pbrSpecularGlossiness"};
  primitive()["material"] = 0;
  Json& gloss =
      (json_["materials"] = Json::array({Json::object()}))[0]["extensions"]["KHR_materials_pbrSpecularGlossiness"];
  const auto extra = [&](const Scene& scene, int parameter) {
    return value(scene, material(scene).extra[parameter]).x;
  };
  // The defaults are a perfect mirror.
  gloss = Json::object();
  Scene scene = load();
  EXPECT_EQ(value(scene, material(scene).reflectance), Vec3f(1.0f));
  EXPECT_EQ(extra(scene, ExtraParameter::metallic), 1.0f);
  EXPECT_EQ(extra(scene, ExtraParameter::roughness), 0.0f);
  EXPECT_NE(join(scene.assumed).find("read as metallic-roughness"), std::string::npos);
  // Another index of refraction, where nothing needs metal; and what is for other readers counts for nothing.
  gloss = Json::parse(R"({"diffuseFactor": [0.5, 0.25, 1, 1], "specularFactor": [0.01, 0.01, 0.01],
    "glossinessFactor": 0.25})");
  json_["materials"][0]["pbrMetallicRoughness"] = {{"baseColorFactor", {0, 0, 0, 1}}};
  scene = load();
  EXPECT_EQ(value(scene, material(scene).reflectance), Vec3f(0.5f, 0.25f, 1));
  EXPECT_EQ(extra(scene, ExtraParameter::roughness), 0.75f);
  EXPECT_EQ(material(scene).extra[ExtraParameter::metallic] < 0 ? 0.0f : extra(scene, ExtraParameter::metallic), 0.0f);
  EXPECT_FLOAT_EQ(material(scene).int_ior, 1.1f / 0.9f);
  gloss["specularFactor"] = {0, 0, 0};
  EXPECT_FLOAT_EQ(material(load()).int_ior, 1.001f);
  gloss["specularFactor"] = {0.2, 0.2, 0.2};
  scene = load();
  const GltfMetal metal = metal_of_specular({0.5, 0.25, 1}, Vec3d(0.2));
  EXPECT_LT(length(value(scene, material(scene).reflectance) - Vec3f(metal.base)), 1e-6f);
  EXPECT_FLOAT_EQ(extra(scene, ExtraParameter::metallic), static_cast<float>(metal.metallic));
  gloss["glossinessFactor"] = 1.0;
  const std::string shiny = load().fingerprint;
  gloss["glossinessFactor"] = 3.2;  // as assimp writes it
  scene = load();
  EXPECT_EQ(scene.fingerprint, shiny);
  EXPECT_NE(join(scene.assumed).find("a glossinessFactor of 3.2 is read as 1"), std::string::npos);
}

TEST_F(GltfTest, SpecularGlossinessTextures) {
  add_picture(255, 128, 64);  // diffuse
  Image8 picture(2, 1, 4);
  picture.data = {255, 255, 255, 255, 0, 0, 0, 51};
  write_image(folder_.file("gloss.png"), picture);
  json_["images"].push_back({{"uri", "gloss.png"}});
  json_["samplers"] = {{{"wrapS", 33071}, {"wrapT", 33071}}};
  json_["textures"] = Json::parse(R"([{"source": 0, "sampler": 0}, {"source": 1, "sampler": 0}])");
  Json& gloss =
      (json_["materials"] = Json::array({Json::object()}))[0]["extensions"]["KHR_materials_pbrSpecularGlossiness"];
  gloss = Json::parse(R"({"diffuseFactor": [0.5, 1, 1, 0.5], "specularFactor": [0.5, 0.5, 0.5], "glossinessFactor": 0.5,
    "diffuseTexture": {"index": 0}, "specularGlossinessTexture": {"index": 1}})");
  json_["materials"][0]["alphaMode"] = "BLEND";
  Scene scene = load();
  const auto at = [&](int texture, float u) {
    return evaluate_texture(texture_view(scene.textures[static_cast<std::size_t>(texture)]), {u, 0.5f});
  };
  const Vec3d diffuse(0.5, decode_srgb(128 / 255.0), decode_srgb(64 / 255.0));
  const auto expect = [&](float u, Vec3d d, Vec3d specular) {
    const GltfMetal metal = metal_of_specular(d, specular);
    EXPECT_LT(length(at(material(scene).reflectance, u) - Vec3f(metal.base)), 1e-5f) << u;
    EXPECT_NEAR(at(material(scene).extra[ExtraParameter::metallic], u).x, metal.metallic, 1e-5) << u;
  };
  expect(0.25f, diffuse, Vec3d(0.5));
  expect(0.75f, diffuse, Vec3d(0.0));
  EXPECT_FLOAT_EQ(at(material(scene).extra[ExtraParameter::roughness], 0.25f).x, 0.5f);
  EXPECT_FLOAT_EQ(at(material(scene).extra[ExtraParameter::roughness], 0.75f).x, 0.9f);  // alpha is not sRGB
  EXPECT_FLOAT_EQ(value(scene, material(scene).opacity).x, 0.5f);
  // Either picture alone.
  gloss.erase("diffuseTexture");
  scene = load();
  expect(0.25f, {0.5, 1, 1}, Vec3d(0.5));
  expect(0.75f, {0.5, 1, 1}, Vec3d(0.0));
  gloss["diffuseTexture"] = {{"index", 0}};
  gloss.erase("specularGlossinessTexture");
  scene = load();
  expect(0.5f, diffuse, Vec3d(0.5));
  EXPECT_FLOAT_EQ(value(scene, material(scene).extra[ExtraParameter::roughness]).x, 0.5f);
  // Pictures that lie otherwise make none.
  gloss["specularGlossinessTexture"] =
      Json::parse(R"({"index": 1, "extensions": {"KHR_texture_transform": {"scale": [2, 2]}}})");
  scene = load();
  EXPECT_NE(join(scene.assumed).find("are read as 0.04"), std::string::npos);
  EXPECT_LT(length(at(material(scene).reflectance, 0.5f) - Vec3f(diffuse)), 1e-5f);
  EXPECT_FLOAT_EQ(material(scene).int_ior, 1.5f);
  gloss["specularGlossinessTexture"].erase("index");
  EXPECT_NE(error().find("needs the index of a texture"), std::string::npos) << error();
}

}  // namespace
}  // namespace octrad
