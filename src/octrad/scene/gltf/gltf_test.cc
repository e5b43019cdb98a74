// glTF: accessors, primitives, nodes, cameras, lights, and what compresses them; files are made here.
#include <meshoptimizer.h>
#include <webp/encode.h>

#include <cmath>
#include <filesystem>

#include "octrad/base/input_file.h"
#include "octrad/base/join.h"
#include "octrad/scene/gltf/gltf_test_helper.h"
#include "octrad/scene/write_xml.h"

namespace octrad {
namespace {

TEST_F(GltfTest, TriangleCameraAndLightThatAreMissing) {
  const Scene scene = load();
  ASSERT_EQ(scene.shapes.size(), 1u);
  EXPECT_EQ(scene.meshes[0].positions, (std::vector<Vec3f>{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}));
  EXPECT_TRUE(scene.meshes[0].normals.empty());  // flat, as glTF says
  ASSERT_EQ(scene.cameras.size(), 1u);
  ASSERT_EQ(scene.environments.size(), 1u);
  const std::string notes = join(scene.assumed);
  EXPECT_NE(notes.find("no sensor"), std::string::npos) << notes;
  EXPECT_NE(notes.find("no light"), std::string::npos) << notes;
  // The camera sees all corners.
  const Camera& camera = scene.cameras[0];
  for (const Vec3f& p : scene.meshes[0].positions) {
    const Vec3f d = p - camera.origin;
    const float depth = dot(d, camera.forward), limit = std::tan(20.0f * kPi / 180.0f) * depth;
    EXPECT_GT(depth, 0.0f);
    EXPECT_LT(std::fabs(dot(d, camera.up)), limit);
    EXPECT_LT(std::fabs(dot(d, camera.right)), limit);
  }
  EXPECT_EQ(material(scene).type, BsdfType::principled);
  EXPECT_EQ(value(scene, material(scene).extra[ExtraParameter::metallic]), Vec3f(1.0f));
  EXPECT_EQ(load_scene(write(true)).fingerprint, scene.fingerprint);  // the container
}

TEST_F(GltfTest, ComponentTypesStrideAndSparse) {
  // Positions as normalised shorts, three numbers of every four.
  json_["bufferViews"].clear();
  json_["accessors"].clear();
  binary_.clear();
  add("VEC3", 5122, 3, gltf_bytes<std::int16_t>({0, 0, 0, 9, 32767, 0, 0, 9, 0, -32768, 16384, 9}),
      {{"normalized", true}});
  json_["bufferViews"][0]["byteStride"] = 8;
  Scene scene = load();
  EXPECT_EQ(scene.meshes[0].positions[1], Vec3f(1, 0, 0));
  EXPECT_EQ(scene.meshes[0].positions[2], Vec3f(0, -1, 16384.0f / 32767.0f));
  // Unsigned bytes, not normalised.
  primitive()["attributes"]["POSITION"] = add("VEC3", 5121, 3, gltf_bytes<std::uint8_t>({0, 0, 0, 255, 0, 0, 0, 7, 0}));
  EXPECT_EQ(load().meshes[0].positions[1], Vec3f(255, 0, 0));
  primitive()["attributes"]["POSITION"] =
      add("VEC3", 5120, 3, gltf_bytes<std::int8_t>({0, 0, 0, -128, 0, 0, 0, 127, 0}), {{"normalized", true}});
  EXPECT_EQ(load().meshes[0].positions[1], Vec3f(-1, 0, 0));
  primitive()["attributes"]["POSITION"] =
      add("VEC3", 5123, 3, gltf_bytes<std::uint16_t>({0, 0, 0, 65535, 0, 0, 0, 9, 0}), {{"normalized", true}});
  EXPECT_EQ(load().meshes[0].positions[1], Vec3f(1, 0, 0));
  // Two values of zeros replaced.
  const int at = view(gltf_bytes<std::uint8_t>({1, 2})), with = view(gltf_bytes<float>({2, 0, 0, 0, 3, 0}));
  json_["accessors"].push_back({{"type", "VEC3"},
                                {"componentType", 5126},
                                {"count", 3},
                                {"sparse",
                                 {{"count", 2},
                                  {"indices", {{"bufferView", at}, {"componentType", 5121}}},
                                  {"values", {{"bufferView", with}}}}}});
  primitive()["attributes"]["POSITION"] = json_["accessors"].size() - 1;
  EXPECT_EQ(load().meshes[0].positions, (std::vector<Vec3f>{{0, 0, 0}, {2, 0, 0}, {0, 3, 0}}));
}

TEST_F(GltfTest, StripsFansAndIndices) {
  primitive()["attributes"]["POSITION"] =
      add("VEC3", 5126, 5, gltf_bytes<float>({0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 1, 0, 0, 2, 0}));
  primitive()["mode"] = 5;
  EXPECT_EQ(load().meshes[0].triangles, (std::vector<Vec3i>{{0, 1, 2}, {1, 3, 2}, {2, 3, 4}}));
  primitive()["mode"] = 6;
  EXPECT_EQ(load().meshes[0].triangles, (std::vector<Vec3i>{{1, 2, 0}, {2, 3, 0}, {3, 4, 0}}));
  for (const auto& [kind, bytes] : {std::pair{5121, gltf_bytes<std::uint8_t>({0, 1, 3, 4, 2, 1})},
                                    std::pair{5123, gltf_bytes<std::uint16_t>({0, 1, 3, 4, 2, 1})},
                                    std::pair{5125, gltf_bytes<std::uint32_t>({0, 1, 3, 4, 2, 1})}}) {
    primitive()["mode"] = 4;
    primitive()["indices"] = add("SCALAR", kind, 6, bytes);
    EXPECT_EQ(load().meshes[0].triangles, (std::vector<Vec3i>{{0, 1, 3}, {4, 2, 1}}));
  }
  // Some of them replaced; without a view of zeros.
  json_["accessors"].back()["sparse"] = {
      {"count", 1},
      {"indices", {{"bufferView", view(std::string(1, 2))}, {"componentType", 5121}}},
      {"values", {{"bufferView", view(gltf_bytes<std::uint32_t>({4}))}}}};
  EXPECT_EQ(load().meshes[0].triangles, (std::vector<Vec3i>{{0, 1, 3}, {3, 2, 1}}));  // vertex 3 is not used
  json_["accessors"].back().erase("bufferView");
  EXPECT_EQ(load().meshes[0].triangles, (std::vector<Vec3i>{{0, 0, 1}, {0, 0, 0}}));
  json_["accessors"].back().erase("sparse");
  EXPECT_NE(error().find("indices need a bufferView"), std::string::npos);
  primitive().erase("indices");
  primitive()["mode"] = 1;
  EXPECT_NE(error().find("neither a shape with triangles nor a sensor"), std::string::npos);
}

// Left over corners, too few of them and missing positions are only warnings of Khronos' validator.
TEST_F(GltfTest, PrimitivesThatAreNotWhole) {
  primitive()["indices"] = add("SCALAR", 5121, 5, gltf_bytes<std::uint8_t>({0, 1, 2, 2, 1}));
  const auto left_out = [&] { return join(load().assumed).find("without a whole triangle") != std::string::npos; };
  EXPECT_EQ(load().meshes.at(0).triangles, (std::vector<Vec3i>{{0, 1, 2}}));
  EXPECT_FALSE(left_out());
  const int two = add("SCALAR", 5121, 2, gltf_bytes<std::uint8_t>({0, 1}));
  for (const int mode : {4, 5, 6}) {
    json_["meshes"][0]["primitives"][1] = {{"attributes", {{"POSITION", 0}}}, {"indices", two}, {"mode", mode}};
    EXPECT_TRUE(left_out()) << mode;
    EXPECT_EQ(load().shapes.size(), 1u);
  }
  json_["meshes"][0]["primitives"][1] = {{"attributes", Json::object()}};
  EXPECT_TRUE(left_out());
}

TEST_F(GltfTest, NodesAndInstances) {
  json_["nodes"] = Json::parse(R"([{"children": [1, 2], "translation": [0, 0, 5]},
    {"mesh": 0, "rotation": [0, 0, 0.7071067811865476, 0.7071067811865476], "scale": [2, 1, 1]}])");
  json_["nodes"].push_back({{"camera", 0}, {"matrix", {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 1, 2, 3, 1}}});
  json_["cameras"] = {
      {{"type", "perspective"}, {"perspective", {{"yfov", 1.0}, {"aspectRatio", 2.0}, {"znear", 0.5}}}}};
  Scene scene = load();
  EXPECT_LT(length(scene.meshes[0].positions[1] - Vec3f(0, 2, 5)), 1e-6f);
  EXPECT_LT(length(scene.meshes[0].positions[2] - Vec3f(-1, 0, 5)), 1e-6f);
  const Camera& camera = scene.cameras[0];
  EXPECT_EQ(camera.origin, Vec3f(1, 2, 8));
  EXPECT_EQ(camera.forward, Vec3f(0, 0, -1));
  EXPECT_EQ(camera.right, Vec3f(1, 0, 0));
  EXPECT_EQ(scene.film.width, 1440);
  EXPECT_NEAR(camera.fov_degrees, 57.29578f, 1e-4f);
  EXPECT_EQ(camera.near_clip, 0.5f);

  json_["cameras"] = {
      {{"type", "orthographic"}, {"orthographic", {{"xmag", 3.0}, {"ymag", 1.5}, {"znear", 1}, {"zfar", 9}}}}};
  scene = load();
  EXPECT_EQ(scene.cameras[0].half_size.x, 3.0f);
  EXPECT_EQ(scene.film.width, 1440);
  EXPECT_EQ(scene.cameras[0].near_clip, 1.0f);

  json_["nodes"][0]["mesh"] = 0;  // a second place: instances of one copy
  scene = load();
  EXPECT_EQ(scene.shapes.size(), 2u);
  EXPECT_EQ(scene.meshes.size(), 1u);
  EXPECT_EQ(scene.placements.size(), 2u);
  json_["nodes"][0]["scale"] = {0, 0, 0};
  EXPECT_NE(error().find("looks nowhere"), std::string::npos);
  json_["nodes"].erase(2);
  json_["nodes"][0]["children"] = {1};
  EXPECT_NE(error().find("neither a shape with triangles nor a sensor"), std::string::npos);
  json_["nodes"][0].erase("scale");
  json_["nodes"][1]["children"] = {0};
  EXPECT_NE(error().find("twice"), std::string::npos);

  // The front stays the front under a mirror, with normals in the file and without.
  json_["nodes"] = Json::parse(R"([{"mesh": 0, "scale": [-1, 1, 1]}])");
  const auto front = [](const TriangleMesh& mesh) {
    Vec3f p[3];
    for (int i = 0; i < 3; ++i) p[i] = mesh.positions[static_cast<std::size_t>(mesh.triangles[0][i])];
    return cross(p[1] - p[0], p[2] - p[0]).z * (mesh.flip_normals ? -1.0f : 1.0f);
  };
  EXPECT_EQ(front(load().meshes[0]), 1.0f);
  primitive()["attributes"]["NORMAL"] = add("VEC3", 5126, 3, gltf_bytes<float>({0, 0, 1, 0, 0, 1, 0, 0, 1}));
  EXPECT_EQ(front(load().meshes[0]), 1.0f);
  primitive()["attributes"].erase("NORMAL");

  json_["nodes"] = Json::parse(R"([{"mesh": 0, "extensions": {"EXT_mesh_gpu_instancing": {"attributes": {}}}}])");
  json_["nodes"][0]["extensions"]["EXT_mesh_gpu_instancing"]["attributes"]["TRANSLATION"] =
      add("VEC3", 5126, 2, gltf_bytes<float>({0, 0, 1, 0, 0, 2}));
  scene = load();
  ASSERT_EQ(scene.placements.size(), 2u);
  EXPECT_EQ(scene.placements[1].point({0, 0, 0}), Vec3f(0, 0, 2));
  json_["nodes"][0]["extensions"]["EXT_mesh_gpu_instancing"]["attributes"]["SCALE"] =  // one of them flat
      add("VEC3", 5126, 2, gltf_bytes<float>({1, 1, 1, 3, 1, 0}));
  scene = load();
  ASSERT_EQ(scene.placements.size(), 2u);
  EXPECT_EQ(scene.placements[1].point({1, 0, 0}), Vec3f(3, 0, 2));
}

TEST_F(GltfTest, MorphTargetsAndSkins) {
  primitive()["targets"] = {{{"POSITION", add("VEC3", 5126, 3, gltf_bytes<float>({0, 0, 0, 0, 0, 1, 0, 0, 2}))}}};
  EXPECT_EQ(load().meshes[0].positions[2], Vec3f(0, 1, 0));
  json_["meshes"][0]["weights"] = {0.5};
  EXPECT_EQ(load().meshes[0].positions[2], Vec3f(0, 1, 1));
  json_["nodes"][0]["weights"] = {2};
  EXPECT_EQ(load().meshes[0].positions[2], Vec3f(0, 1, 4));
  json_["nodes"][0]["weights"] = {1, 2};
  EXPECT_NE(error().find("a list of 1 numbers"), std::string::npos);

  // Bound one above the joint, which stands at x = 5; the node's own place counts for nothing.
  primitive().erase("targets");
  json_["meshes"][0].erase("weights");
  json_["nodes"] = Json::parse(
      R"([{"mesh": 0, "skin": 0, "translation": [9, 9, 9], "children": [1, 2]}, {"translation": [-4, -9, -9]}, {"translation": [-9, -9, -9]}])");
  json_["skins"] = {{{"joints", {1, 2}},
                     {"inverseBindMatrices",
                      add("MAT4", 5126, 2, gltf_bytes<float>({1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, -1, 0, 1,
                                                              1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0,  0, 1}))}}};
  EXPECT_NE(error().find("no JOINTS_0"), std::string::npos);
  primitive()["attributes"]["JOINTS_0"] =
      add("VEC4", 5121, 3, gltf_bytes<std::uint8_t>({0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0}));
  primitive()["attributes"]["WEIGHTS_0"] =
      add("VEC4", 5126, 3, gltf_bytes<float>({1, 0, 0, 0, 1, 0, 0, 0, 0.5f, 0.5f, 0, 0}));
  const Scene posed = load();
  EXPECT_EQ(posed.meshes[0].positions, (std::vector<Vec3f>{{5, -1, 0}, {1, 0, 0}, {2.5f, 0.5f, 0}}));
  EXPECT_EQ(join(posed.assumed).find("skin"), std::string::npos);
  // A vertex without weights stays where it is.
  primitive()["attributes"]["WEIGHTS_0"] =
      add("VEC4", 5126, 3, gltf_bytes<float>({1, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0}));
  EXPECT_EQ(load().meshes[0].positions[2], Vec3f(0, 1, 0));
  json_["skins"][0]["joints"] = {1, 7};
  EXPECT_NE(error().find("joint 1 is not in the scene"), std::string::npos);
}

// A picture beside a file that is named with its folder, from another one.
TEST_F(GltfTest, PicturesOfAFileInAnotherFolder) {
  add_picture(255, 128, 64);
  json_["materials"] = Json::parse(R"([{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}])");
  const Scene scene = load_scene(std::filesystem::relative(write()).string());
  EXPECT_NEAR(value(scene, material(scene).reflectance).y, 0.21586f, 1e-5f);
}

TEST_F(GltfTest, Lights) {
  json_["nodes"] = Json::parse(R"([{"mesh": 0, "children": [1, 2, 3]},
    {"translation": [1, 2, 3], "scale": [2, 2, 2], "extensions": {"KHR_lights_punctual": {"light": 0}}},
    {"rotation": [-0.7071067811865476, 0, 0, 0.7071067811865476], "extensions": {"KHR_lights_punctual": {"light": 1}}},
    {"extensions": {"KHR_lights_punctual": {"light": 2}}}])");
  json_["extensions"] = Json::parse(R"({"KHR_lights_punctual": {"lights": [
    {"type": "point", "color": [1, 0.5, 0], "intensity": 10}, {"type": "directional", "intensity": 3},
    {"type": "spot", "spot": {"innerConeAngle": 0.25, "outerConeAngle": 0.5}}]}})");
  const Scene scene = load();
  ASSERT_EQ(scene.delta_lights.size(), 3u);
  EXPECT_EQ(scene.delta_lights[0].position, Vec3f(1, 2, 3));
  EXPECT_EQ(scene.delta_lights[0].intensity, Vec3f(10, 5, 0));
  EXPECT_LT(length(scene.delta_lights[1].axis - Vec3f(0, -1, 0)), 1e-6f);
  EXPECT_EQ(scene.delta_lights[2].axis, Vec3f(0, 0, -1));
  EXPECT_NEAR(scene.delta_lights[2].cos_cutoff, std::cos(0.5f), 1e-6f);
  EXPECT_NEAR(scene.delta_lights[2].cos_beam, std::cos(0.25f), 1e-6f);
  EXPECT_TRUE(scene.environments.empty());
  for (const DeltaLight& l : scene.delta_lights) EXPECT_FALSE(l.through_masks);
  json_["materials"] =
      Json::parse(R"([{"alphaMode": "BLEND", "pbrMetallicRoughness": {"baseColorFactor": [1, 1, 1, 0.5]}}])");
  for (const DeltaLight& l : load().delta_lights) EXPECT_FALSE(l.through_masks);  // nothing has the material
  primitive()["material"] = 0;
  for (const DeltaLight& l : load().delta_lights) EXPECT_TRUE(l.through_masks);

  // Scaled to nothing: a point still shines.
  for (const char* node : {"/nodes/1", "/nodes/2", "/nodes/3"}) json_[Json::json_pointer(node)]["scale"] = {0, 0, 0};
  const Scene without = load();
  EXPECT_EQ(without.delta_lights.size(), 1u);
  EXPECT_NE(join(without.assumed).find("shines nowhere"), std::string::npos);
}

TEST_F(GltfTest, Extensions) {
  json_["materials"] = Json::parse(R"([{"extensions": {"KHR_materials_specular": {"specularTexture": {"index": 0}},
    "KHR_materials_clearcoat": {"clearcoatFactor": 1}, "KHR_materials_transmission": {"transmissionFactor": 1}}}])");
  primitive()["material"] = 0;
  for (const char* note : {"specularTexture is left out", "KHR_materials_clearcoat is left out of thin glass"})
    EXPECT_NE(join(load().assumed).find(note), std::string::npos) << note;
  json_.erase("materials");
  primitive().erase("material");
  json_["extensionsUsed"] = {"KHR_materials_unlit", "VENDOR_thing"};
  EXPECT_NE(join(load().assumed).find("VENDOR_thing"), std::string::npos);
  json_["extensionsRequired"] = {"KHR_draco_mesh_compression", "KHR_mesh_quantization", "VENDOR_thing"};
  EXPECT_NE(error().find("KHR_draco_mesh_compression, which is not supported; decompress"), std::string::npos);
  EXPECT_EQ(load(true).refused.size(), 2u);
  EXPECT_EQ(check_scene_file(write()).refused.size(), 2u);
}

class MeshoptTest : public GltfTest {
 protected:
  using Bytes = std::vector<unsigned char>;
  // A view of compressed bytes; what it says for readers that cannot decode them lies in a buffer that is not there.
  int compressed(const Bytes& bytes, int count, int stride, const char* mode, const char* filter = "NONE") {
    const int index = view(std::string(bytes.begin(), bytes.end()));
    Json& own = json_["bufferViews"][static_cast<std::size_t>(index)];
    own["extensions"]["EXT_meshopt_compression"] = {{"buffer", 0},
                                                    {"byteOffset", own["byteOffset"]},
                                                    {"byteLength", own["byteLength"]},
                                                    {"byteStride", stride},
                                                    {"count", count},
                                                    {"mode", mode},
                                                    {"filter", filter}};
    own["byteOffset"] = 0;
    own["byteLength"] = count * stride;
    own["buffer"] = 1;
    if (std::string(mode) == "ATTRIBUTES") own["byteStride"] = stride;
    return index;
  }
  template <typename T>
  static Bytes attributes(const std::vector<T>& values, std::size_t count) {
    const std::size_t stride = values.size() * sizeof(T) / count;
    Bytes out(meshopt_encodeVertexBufferBound(count, stride));
    out.resize(meshopt_encodeVertexBuffer(out.data(), out.size(), values.data(), count, stride));
    return out;
  }
  template <typename Encode>
  static Bytes indices(Encode encode) {
    Bytes out(1000);
    out.resize(encode(out.data(), out.size(), kOrder.data(), kOrder.size()));
    return out;
  }
  void accessor(const char* type, int component, int count, int view, bool normalized = false) {
    json_["accessors"].push_back({{"type", type},
                                  {"componentType", component},
                                  {"count", count},
                                  {"bufferView", view},
                                  {"normalized", normalized}});
  }
  // A square of two triangles, with normals in bytes or shorts.
  void set_square(bool triangles, int index_bytes, bool shorts) {
    json_["accessors"] = json_["bufferViews"] = Json::array();
    binary_.clear();
    accessor("VEC3", 5126, 4, compressed(attributes(kPositions, 4), 4, 12, "ATTRIBUTES"));
    accessor("SCALAR", index_bytes == 2 ? 5123 : 5125, 6,
             compressed(triangles ? indices([](auto... a) { return meshopt_encodeIndexBuffer(a...); })
                                  : indices([](auto... a) { return meshopt_encodeIndexSequence(a...); }),
                        6, index_bytes, triangles ? "TRIANGLES" : "INDICES"));
    if (shorts) {
      std::vector<short> normals(16);
      meshopt_encodeFilterOct(normals.data(), 4, 8, 14, kNormals.data());
      accessor("VEC3", 5122, 4, compressed(attributes(normals, 4), 4, 8, "ATTRIBUTES", "OCTAHEDRAL"), true);
    } else {
      std::vector<signed char> normals(16);
      meshopt_encodeFilterOct(normals.data(), 4, 4, 8, kNormals.data());
      accessor("VEC3", 5120, 4, compressed(attributes(normals, 4), 4, 4, "ATTRIBUTES", "OCTAHEDRAL"), true);
    }
    primitive() = Json::parse(R"({"attributes": {"POSITION": 0, "NORMAL": 2}, "indices": 1})");
    json_["extensionsRequired"] = {"EXT_meshopt_compression", "KHR_mesh_quantization"};
    more_buffers_ = {{{"byteLength", 1000}}};
  }

  static inline const std::vector<float> kPositions = {0, 0, 0, 1, 0, 0, 0, 2, 0, 1, 2, 0};
  static inline const std::vector<unsigned> kOrder = {0, 1, 2, 2, 1, 3};
  // With a fourth value that nothing reads.
  static inline const std::vector<float> kNormals = {0.6f, 0, 0.8f, 0, 0, 0, 1, 0, 0, -0.6f, -0.8f, 0, 0, 1, 0, 0};
};

// What encodes and decodes is one library; pictures of scenes that gltfpack compressed agree with those before.
TEST_F(MeshoptTest, EveryMode) {
  for (const bool triangles : {true, false}) {
    for (const int index_bytes : {2, 4}) {
      set_square(triangles, index_bytes, index_bytes == 2);
      const Scene scene = load();
      ASSERT_EQ(scene.meshes.size(), 1u);
      const TriangleMesh& mesh = scene.meshes[0];
      ASSERT_EQ(mesh.positions.size(), 4u);
      for (std::size_t i = 0; i < 4; ++i) {
        EXPECT_EQ(mesh.positions[i], Vec3f(kPositions[3 * i], kPositions[3 * i + 1], kPositions[3 * i + 2]));
        const Vec3f normal(kNormals[4 * i], kNormals[4 * i + 1], kNormals[4 * i + 2]);
        EXPECT_LT(length(mesh.normals[i] - normal), index_bytes == 2 ? 0.0005f : 0.02f) << i;
      }
      EXPECT_EQ(mesh.triangles, (std::vector<Vec3i>{{0, 1, 2}, {2, 1, 3}}));
    }
  }
  // A buffer that no view shows is not looked for, nor a fallback that is said to be one.
  more_buffers_ = {
      {{"byteLength", 1000}, {"uri", "none.bin"}, {"extensions", {{"EXT_meshopt_compression", {{"fallback", true}}}}}},
      {{"byteLength", 1000}, {"uri", "none.bin"}}};
  EXPECT_EQ(load().meshes.size(), 1u);
  view("x");
  json_["bufferViews"].back()["buffer"] = 2;
  EXPECT_NE(error().find("none.bin\" does not exist"), std::string::npos);
}

TEST_F(MeshoptTest, FiltersOfPlaces) {
  const std::vector<float> places = {1, 2, 3, -4, 0.5f, 100}, turns = {0, 0, 0.6f, 0.8f, 0, 0, 0, 1};
  std::vector<unsigned> exponents(6);
  meshopt_encodeFilterExp(exponents.data(), 2, 12, 15, places.data());
  std::vector<short> quaternions(8);
  meshopt_encodeFilterQuat(quaternions.data(), 2, 8, 16, turns.data());
  accessor("VEC3", 5126, 2, compressed(attributes(exponents, 2), 2, 12, "ATTRIBUTES", "EXPONENTIAL"));
  accessor("VEC4", 5122, 2, compressed(attributes(quaternions, 2), 2, 8, "ATTRIBUTES", "QUATERNION"), true);
  more_buffers_ = {{{"byteLength", 1000}}};
  json_["nodes"][0]["extensions"]["EXT_mesh_gpu_instancing"]["attributes"] = {{"TRANSLATION", 1}, {"ROTATION", 2}};
  const Scene scene = load();
  ASSERT_EQ(scene.placements.size(), 2u);
  EXPECT_LT(length(scene.placements[0].point(Vec3f(0.0f)) - Vec3f(1, 2, 3)), 1e-3f);
  EXPECT_LT(length(scene.placements[1].point(Vec3f(0.0f)) - Vec3f(-4, 0.5f, 100)), 1e-2f);
  EXPECT_LT(length(scene.placements[0].point(Vec3f(1, 0, 0)) - Vec3f(1.28f, 2.96f, 3)), 1e-3f);  // twice atan(.6 / .8)
}

// What the library asserts, and data that are none.
TEST_F(MeshoptTest, BrokenFiles) {
  set_square(true, 2, false);
  const Json good = json_;
  const auto expect = [&](int view, const char* key, const Json& value, const char* message, bool of_view = false) {
    json_ = good;
    Json& changed = json_["bufferViews"][static_cast<std::size_t>(view)];
    (of_view ? changed : changed["extensions"]["EXT_meshopt_compression"])[key] = value;
    EXPECT_NE(error().find(message), std::string::npos) << key << ": " << error();
  };
  expect(1, "byteStride", 6, "byteStride does not fit");
  expect(1, "byteStride", 0, "byteStride does not fit");
  expect(0, "byteStride", 260, "byteStride is not that of the compressed data");
  expect(1, "mode", "LINES", "mode must be");
  expect(1, "mode", "ATTRIBUTES", "byteStride does not fit");
  expect(1, "filter", "OCTAHEDRAL", "filter \"OCTAHEDRAL\" does not fit");
  expect(2, "filter", "QUATERNION", "filter \"QUATERNION\" does not fit");
  expect(1, "count", 5, "must be a multiple of 3");
  expect(1, "count", 0, "count is out of range");
  expect(1, "count", 1e15, "count is out of range");
  expect(1, "count", 90, "are broken");
  expect(1, "count", 90000, "are broken");  // before there is memory for them
  expect(0, "byteLength", 20, "are broken");
  expect(0, "byteLength", 99999, "beyond the buffer");
  expect(0, "buffer", 1, "has no uri, and the file no binary chunk for it");
  expect(0, "byteLength", 12, "byteLength is not that of the compressed data", true);
  expect(0, "byteStride", 8, "byteStride is not that of the compressed data", true);
  // Many views of the same bytes.
  json_ = good;
  const std::vector<float> zeros(3 * 4096);
  const Json much =
      json_["bufferViews"][static_cast<std::size_t>(compressed(attributes(zeros, 4096), 4096, 12, "ATTRIBUTES"))];
  EXPECT_EQ(error(), "");
  for (int i = 0; i < 1000; ++i) json_["bufferViews"].push_back(much);
  EXPECT_NE(error().find("compressed data are used too often"), std::string::npos) << error();
}

TEST_F(GltfTest, TexturesOfWebp) {
  const std::uint8_t color[3] = {255, 128, 64};
  std::uint8_t* out = nullptr;
  const std::size_t size = WebPEncodeLosslessRGB(color, 1, 1, 3, &out);
  const std::string bytes(reinterpret_cast<const char*>(out), size);
  WebPFree(out);
  add_picture(255, 128, 64);
  json_["materials"] =
      Json::parse(R"([{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}, "metallicFactor": 0}}])");
  const Scene expected = load();
  json_["extensionsRequired"] = {"EXT_texture_webp"};
  json_["textures"] = Json::parse(R"([{"extensions": {"EXT_texture_webp": {"source": 0}}}])");
  folder_.write("a.webp", bytes);
  for (const bool inside : {false, true}) {
    json_["images"][0] = {{"uri", "a.webp"}};
    if (inside) json_["images"][0] = {{"bufferView", view(bytes)}, {"mimeType", "image/webp"}};
    Scene scene;
    const SceneFiles files = scene_as_xml(write(), folder_.file("o.xml"), {}, scene);
    const auto base = [&](const Scene& s) { return value(s, material(s).reflectance); };
    EXPECT_EQ(base(scene), base(expected));
    // Mitsuba does not read WebP.
    std::filesystem::create_directory(folder_.path() / "o-files");
    for (const auto& [name, content] : files.others) folder_.write(name, content());
    EXPECT_TRUE(std::filesystem::exists(folder_.path() / "o-files/picture0.png"));
    EXPECT_EQ(base(load_scene(folder_.write("o.xml", files.xml))), base(expected));
    std::filesystem::remove_all(folder_.path() / "o-files");
  }
  // The picture for readers that do not know WebP need not be there.
  json_["images"].push_back({{"uri", "none.png"}});
  json_["textures"][0]["source"] = 1;
  const Scene scene = load();
  EXPECT_EQ(value(scene, material(scene).reflectance), value(expected, material(expected).reflectance));
  json_["textures"] = Json::parse(R"([{"extensions": {"EXT_texture_webp": {}}}])");
  EXPECT_NE(error().find("textures[0]: has no source"), std::string::npos) << error();
}

TEST_F(GltfTest, ConvertedToXml) {
  add_picture(255, 128, 64);
  json_["materials"] = Json::parse(R"([{"pbrMetallicRoughness": {"baseColorFactor": [0.5, 1, 0.25, 1],
    "baseColorTexture": {"index": 0}, "metallicRoughnessTexture": {"index": 0}}, "normalTexture": {"index": 0}}])");
  primitive()["attributes"]["NORMAL"] = add("VEC3", 5126, 3, gltf_bytes<float>({0, 0, 1, 0, 0, 2, 0, 1, 1}));
  json_["nodes"].push_back({{"mesh", 0}, {"translation", {0, 0, 1}}});
  json_["scenes"][0]["nodes"] = {0, 1};
  json_["images"][0] = {{"bufferView", view(read_file(folder_.file("a b.png")))}, {"mimeType", "image/png"}};
  Scene first;
  const SceneFiles files = scene_as_xml(write(true), folder_.file("o.xml"), {}, first);
  folder_.write("o.xml", files.xml);
  EXPECT_EQ(files.others.size(), 5u);  // the mesh, the picture, and three made of it
  std::filesystem::create_directory(folder_.path() / "o-files");
  for (const auto& [name, bytes] : files.others) folder_.write(name, bytes());
  const Scene second = load_scene(folder_.file("o.xml"));
  EXPECT_EQ(second.fingerprint, first.fingerprint) << files.xml;
  EXPECT_EQ(second.cameras[0].origin, first.cameras[0].origin);
}

TEST_F(GltfTest, UrisAreRelativePaths) {
  for (const char* uri : {"/etc/passwd", "file:///etc/passwd", "http://example.org/a.bin", "\\a.bin"}) {
    json_["buffers"] = {{{"byteLength", 4}, {"uri", uri}}};
    try {
      load_scene(folder_.write("s.gltf", json_.dump()));
      FAIL() << uri;
    } catch (const InputError& e) {
      EXPECT_NE(std::string(e.what()).find("s.gltf: buffers[0]: the uri"), std::string::npos) << e.what();
    }
  }
  // Of a folder beside.
  std::filesystem::create_directory(folder_.path() / "models");
  folder_.write("a.bin", binary_);
  for (const char* uri : {"../a.bin", "sub/../../a.bin", "%2e%2e/a.bin"}) {
    std::filesystem::create_directory(folder_.path() / "models" / "sub");
    json_["buffers"] = {{{"byteLength", binary_.size()}, {"uri", uri}}};
    EXPECT_EQ(load_scene(folder_.write("models/s.gltf", json_.dump())).shapes.size(), 1u) << uri;
  }
}

TEST_F(GltfTest, TextThatIsNotUtf8) {
  json_["nodes"][0]["name"] = "caf";
  std::string text = json_.dump();
  text.replace(text.find("caf"), 3, "caf\xe9");
  try {
    load_scene(folder_.write("s.gltf", text));
    FAIL();
  } catch (const InputError& e) {
    EXPECT_NE(std::string(e.what()).find("not valid JSON: not UTF-8"), std::string::npos) << e.what();
  }
}

// What is scaled to nothing along one axis alone is seen.
TEST_F(GltfTest, FlatNodes) {
  json_["nodes"][0]["scale"] = {2, 1, 0};
  const Scene scene = load();
  ASSERT_EQ(scene.shapes.size(), 1u);
  EXPECT_EQ(scene.meshes[0].positions[1], Vec3f(2, 0, 0));
  json_["nodes"][0]["scale"] = {0, 0, 0};
  EXPECT_NE(error().find("neither a shape"), std::string::npos) << error();
}

TEST_F(GltfTest, MatricesWithRoundings) {
  json_["nodes"][0]["matrix"] = {2, 0, 0, 1e-9, 0, 2, 0, 0, 0, 0, 2, 0, 4, 0, 0, 0.9999999};
  EXPECT_LT(length(load().meshes[0].positions[1] - Vec3f(6, 0, 0)), 1e-5f);
  json_["nodes"][0]["matrix"] = {2, 0, 0, 0.01, 0, 2, 0, 0, 0, 0, 2, 0, 4, 0, 0, 1};
  EXPECT_NE(error().find("the last row of the matrix"), std::string::npos);
}

TEST_F(GltfTest, TextureCoordinatesOfThreeNumbers) {
  add_picture(255, 128, 64);
  json_["materials"] = Json::parse(R"([{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}])");
  primitive()["material"] = 0;
  const Scene two = load();
  primitive()["attributes"]["TEXCOORD_0"] = add("VEC3", 5126, 3, gltf_bytes<float>({0, 1, 5, 1, 1, 5, 0, 0, 5}));
  EXPECT_EQ(load().meshes[0].uvs, two.meshes[0].uvs);
}

// A hidden node and what hangs on it is not there, lights included; cameras look all the same.
TEST_F(GltfTest, HiddenNodes) {
  json_["extensionsRequired"] = {"KHR_node_visibility"};
  json_["cameras"] = Json::parse(R"([{"type": "perspective", "perspective": {"yfov": 0.7, "znear": 0.1}}])");
  json_["nodes"] =
      Json::parse(R"([{"mesh": 0}, {"mesh": 0, "translation": [0, 0, 1]}, {"children": [1, 3]}, {"camera": 0}])");
  json_["scenes"][0]["nodes"] = {0, 2};
  json_["nodes"][1]["extensions"]["KHR_lights_punctual"]["light"] = 0;
  json_["extensions"] = Json::parse(R"({"KHR_lights_punctual": {"lights": [{"type": "point"}]}})");
  EXPECT_EQ(load().shapes.size(), 2u);
  EXPECT_EQ(load().delta_lights.size(), 1u);
  json_["nodes"][2]["extensions"]["KHR_node_visibility"]["visible"] = false;
  Scene scene = load();
  EXPECT_EQ(scene.shapes.size(), 1u);
  EXPECT_TRUE(scene.delta_lights.empty());
  EXPECT_EQ(scene.cameras.size(), 1u);
  json_["nodes"][2]["extensions"]["KHR_node_visibility"] = Json::object();
  EXPECT_EQ(load().shapes.size(), 2u);
}

}  // namespace
}  // namespace octrad
