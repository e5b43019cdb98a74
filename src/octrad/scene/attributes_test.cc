// Attributes of meshes as textures.
#include <gtest/gtest.h>

#include "octrad/base/error.h"
#include "octrad/base/folder_test_helper.h"
#include "octrad/base/frame.h"
#include "octrad/scene/load.h"
#include "octrad/scene/mesh.h"
#include "octrad/scene/texture.h"

namespace octrad {
namespace {

// Three vertices and a second triangle; a quadrangle as the last face.
const std::string kPly =
    "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
    "property uchar red\nproperty uchar green\nproperty uchar blue\nproperty float weight_0\n"
    "element face 2\nproperty list uchar int vertex_indices\nproperty double tint_r\nproperty double tint_g\n"
    "property double tint_b\nproperty float level_x\nend_header\n"
    "0 0 0 255 0 51 0.1\n1 0 0 0 255 102 0.2\n1 1 0 51 51 51 0.3\n0 1 0 0 0 0 0.4\n"
    "3 0 1 2 0.5 0.25 0 7\n4 0 1 2 3 0.75 1 0.5 0.125\n";

class AttributesTest : public ::testing::Test {
 protected:
  AttributesTest() { folder_.write("m.ply", kPly); }
  std::string shape(const std::string& attribute, const std::string& parameter = "reflectance",
                    const std::string& more = "") const {
    return "<shape type=\"ply\"><string name=\"filename\" value=\"m.ply\"/><bsdf type=\"" +
           std::string(parameter == "opacity" ? "mask" : "diffuse") + "\"><texture type=\"mesh_attribute\" name=\"" +
           parameter + "\"><string name=\"name\" value=\"" + attribute + "\"/>" + more + "</texture>" +
           (parameter == "opacity" ? "<bsdf type=\"diffuse\"/>" : "") + "</bsdf></shape>";
  }
  Scene load(const std::string& body) const {
    return load_scene(
        folder_.write("s.xml", "<scene version=\"3.0.0\"><sensor type=\"perspective\"/>\n" + body + "</scene>"));
  }
  // The texture of a mesh at barycentric coordinates of a triangle.
  static Vec3f at(const Scene& scene, int texture, int shape, int triangle, float u, float v) {
    const TriangleMesh& mesh =
        scene.meshes.at(static_cast<std::size_t>(scene.shapes.at(static_cast<std::size_t>(shape)).geometry));
    const Vec3i t = mesh.triangles.at(static_cast<std::size_t>(triangle));
    const auto uv = [&](int i) { return mesh.uvs.at(static_cast<std::size_t>(i)); };
    return evaluate_texture(texture_view(scene.textures.at(static_cast<std::size_t>(texture))),
                            uv(t.x) * (1.0f - u - v) + uv(t.y) * u + uv(t.z) * v);
  }
  std::string error(const std::string& body) const {
    try {
      load(body);
    } catch (const Error& e) {
      return e.what();
    }
    return "no error";
  }
  TestFolder folder_;
};

void expect_near(Vec3f found, Vec3f expected) {
  for (int c = 0; c < 3; ++c) EXPECT_NEAR(found[c], expected[c], 1e-5f);
}

TEST_F(AttributesTest, AreReadFromPly) {
  const RawMesh mesh =
      parse_ply("m.ply", kPly, {"vertex_color", "vertex_weight", "face_tint_color", "face_level", "face_none"});
  ASSERT_EQ(mesh.triangles.size(), 3u);
  ASSERT_EQ(mesh.attributes.size(), 4u);
  EXPECT_EQ(mesh.attributes[0].channels, 3);
  EXPECT_EQ(mesh.attributes[0].values, (std::vector<float>{255, 0, 51, 0, 255, 102, 51, 51, 51, 0, 0, 0}));
  EXPECT_EQ(mesh.attributes[1].values, (std::vector<float>{0.1f, 0.2f, 0.3f, 0.4f}));
  // Of both triangles of the quadrangle.
  EXPECT_EQ(mesh.attributes[2].values, (std::vector<float>{0.5f, 0.25f, 0, 0.75f, 1, 0.5f, 0.75f, 1, 0.5f}));
  EXPECT_EQ(mesh.attributes[3].values, (std::vector<float>{7, 0.125f, 0.125f}));
  EXPECT_EQ(parse_ply("m.ply", kPly).attributes.size(), 0u);
}

// Values that Mitsuba 3.9.1 reads.
TEST_F(AttributesTest, IntegersAreEncodedShares) {
  struct {
    const char *type, *largest, *half;
    std::vector<float> expected;
  } const cases[] = {{"uchar", "255", "128", {255, 128, 0}},
                     {"char", "127", "64", {1, 0.2177f, 0}},
                     {"ushort", "65535", "32768", {1, 0.21405f, 0}},
                     {"int", "2147483647", "1073741824", {1, 0.21404f, 0}},
                     {"uint", "4294967295", "2147483648", {1, 0.21404f, 0}}};
  for (const auto& c : cases) {
    const RawMesh mesh = parse_ply("m.ply",
                                   "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
                                   "property float z\nproperty " +
                                       std::string(c.type) +
                                       " weight_0\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n"
                                       "0 0 0 " +
                                       c.largest + "\n1 0 0 " + c.half + "\n0 1 0 0\n3 0 1 2\n",
                                   {"vertex_weight"});
    ASSERT_EQ(mesh.attributes.at(0).values.size(), 3u) << c.type;
    for (std::size_t i = 0; i < 3; ++i) EXPECT_NEAR(mesh.attributes[0].values[i], c.expected[i], 1e-5f) << c.type;
  }
}

TEST_F(AttributesTest, AreInterpolatedOverTriangles) {
  const std::string scale = "<float name=\"scale\" value=\"0.00392156862745098\"/>";
  Scene scene = load(shape("vertex_color", "reflectance", scale) + shape("face_tint_color"));
  const auto texture = [&](int shape) {
    return scene.materials.at(static_cast<std::size_t>(scene.shapes.at(static_cast<std::size_t>(shape)).material))
        .reflectance;
  };
  const Vec3f corners[4] = {{1, 0, 0.2f}, {0, 1, 0.4f}, {0.2f, 0.2f, 0.2f}, {0, 0, 0}};
  const int vertices[3][3] = {{0, 1, 2}, {0, 1, 2}, {0, 2, 3}};
  const Vec3f tints[3] = {{0.5f, 0.25f, 0}, {0.75f, 1, 0.5f}, {0.75f, 1, 0.5f}};
  for (int i = 0; i < 3; ++i) {
    for (const Vec2f b : {Vec2f{0, 0}, Vec2f{1, 0}, Vec2f{0, 1}, Vec2f{0.25f, 0.5f}, Vec2f{0.5f, 0.5f}}) {
      const int* v = vertices[i];
      expect_near(at(scene, texture(0), 0, i, b.x, b.y),
                  corners[v[0]] * (1.0f - b.x - b.y) + corners[v[1]] * b.x + corners[v[2]] * b.y);
      expect_near(at(scene, texture(1), 1, i, b.x, b.y), tints[i]);
    }
  }
  // As a number, and one bsdf for several shapes, each with its own values.
  scene = load(
      R"(<bsdf type="mask" id="m"><texture type="mesh_attribute" name="opacity"><string name="name" value="vertex_weight"/></texture><bsdf type="diffuse"/></bsdf>
<shape type="ply"><string name="filename" value="m.ply"/><ref id="m"/></shape><shape type="ply"><string name="filename" value="m.ply"/><ref id="m"/></shape>)");
  EXPECT_NE(scene.shapes[0].material, scene.shapes[1].material);
  expect_near(
      at(scene, scene.materials.at(static_cast<std::size_t>(scene.shapes[1].material)).opacity, 1, 2, 0.0f, 1.0f),
      Vec3f(0.4f));
  // One attribute for two parameters.
  scene = load(
      R"(<shape type="ply"><string name="filename" value="m.ply"/><bsdf type="principled"><texture type="mesh_attribute" name="metallic"><string name="name" value="vertex_weight"/></texture>
<texture type="mesh_attribute" name="roughness"><string name="name" value="vertex_weight"/><float name="scale" value="2"/></texture></bsdf></shape>)");
  using P = ExtraParameter;
  for (const auto& [parameter, factor] : {std::pair(P::metallic, 1.0f), std::pair(P::roughness, 2.0f)})
    expect_near(at(scene, scene.materials.at(1).extra[parameter], 0, 2, 0.0f, 1.0f), Vec3f(0.4f * factor));
  // The positions are those of the file.
  const TriangleMesh& mesh = scene.meshes[0];
  EXPECT_EQ(mesh.positions.at(static_cast<std::size_t>(mesh.triangles[2].z)), Vec3f(0, 1, 0));
  EXPECT_EQ(mesh.normals.size(), mesh.positions.size());
}

// Anisotropic surfaces and normal maps turn with the coordinates of the file, not from triangle to triangle.
TEST_F(AttributesTest, CoordinatesKeepTheirDirections) {
  // Of the last triangle all corners have the same coordinates.
  folder_.write("uv.ply",
                "ply\nformat ascii 1.0\nelement vertex 7\nproperty float x\nproperty float y\nproperty float z\n"
                "property float u\nproperty float v\nproperty float weight_0\n"
                "element face 3\nproperty list uchar int vertex_indices\nend_header\n"
                "0 0 0 0.2 0.3 0.1\n1 0 0 0.9 0.1 0.2\n1 1 0 0.6 1.7 0.3\n0 1 0 -0.5 0.8 0.9\n"
                "3 0 0 0.5 0.5 0.2\n4 0 1 0.5 0.5 0.4\n3 1 0 0.5 0.5 0.7\n3 0 1 2\n3 0 2 3\n3 4 5 6\n");
  const auto shape_of = [](const std::string& bsdf) {
    return "<shape type=\"ply\"><string name=\"filename\" value=\"uv.ply\"/>" + bsdf + "</shape>";
  };
  const Scene scene = load(
      shape_of(
          R"(<bsdf type="diffuse"><texture type="mesh_attribute" name="reflectance"><string name="name" value="vertex_weight"/></texture></bsdf>)") +
      shape_of(R"(<bsdf type="diffuse"/>)"));
  const float weights[3][3] = {{0.1f, 0.2f, 0.3f}, {0.1f, 0.3f, 0.9f}, {0.2f, 0.4f, 0.7f}};
  // Directions in which the position moves along u and along v.
  const auto along = [](const TriangleMesh& mesh, int triangle, Vec3f& u, Vec3f& v) {
    const Vec3i t = mesh.triangles.at(static_cast<std::size_t>(triangle));
    const auto p = [&](int i) { return mesh.positions.at(static_cast<std::size_t>(i)); };
    const auto uv = [&](int i) { return mesh.uvs.at(static_cast<std::size_t>(i)); };
    const Vec2f d1 = uv(t.y) - uv(t.x), d2 = uv(t.z) - uv(t.x);
    const float determinant = d1.x * d2.y - d1.y * d2.x;
    const Frame frame = make_frame(normalize(cross(p(t.y) - p(t.x), p(t.z) - p(t.x))));
    u = frame.s;
    v = frame.t;
    if (determinant == 0.0f) return;
    u = normalize(((p(t.y) - p(t.x)) * d2.y - (p(t.z) - p(t.x)) * d1.y) / determinant);
    v = normalize(((p(t.z) - p(t.x)) * d1.x - (p(t.y) - p(t.x)) * d2.x) / determinant);
  };
  const int texture = scene.materials.at(static_cast<std::size_t>(scene.shapes.at(0).material)).reflectance;
  for (int i = 0; i < 3; ++i) {
    Vec3f u[2], v[2];
    for (std::size_t k = 0; k < 2; ++k) along(scene.meshes[k], i, u[k], v[k]);
    EXPECT_LT(length(u[0] - u[1]), 1e-4f) << i;
    EXPECT_LT(length(v[0] - v[1]), 1e-4f) << i;
    for (const Vec2f b : {Vec2f{0, 0}, Vec2f{1, 0}, Vec2f{0, 1}, Vec2f{0.25f, 0.5f}}) {
      const float* w = weights[i];
      expect_near(at(scene, texture, 0, i, b.x, b.y), Vec3f(w[0] * (1.0f - b.x - b.y) + w[1] * b.x + w[2] * b.y));
    }
  }
}

TEST_F(AttributesTest, Mistakes) {
  const auto bad = [&](const std::string& body, const std::string& part) {
    const std::string message = error(body);
    EXPECT_NE(message.find(part), std::string::npos) << message;
  };
  bad(shape("vertex_colour"), "has no attribute \"vertex_colour\"");
  bad(shape("color"), "begins with vertex_ or face_");
  bad(shape("vertex_color"), "a reflectance must be between 0 and 1");
  bad("<shape type=\"sphere\"><bsdf type=\"diffuse\"><texture type=\"mesh_attribute\" name=\"reflectance\"><string name=\"name\" value=\"vertex_color\"/></texture></bsdf></shape>",
      "shape \"sphere\" has no mesh attributes");
  bad("<shape type=\"sphere\"><bsdf type=\"diffuse\"><texture type=\"volume\" name=\"reflectance\"/></bsdf></shape>",
      "bake what the volume shows");
  // Materials that refer to each other in a long chain.
  std::string chain = "<bsdf type=\"diffuse\" id=\"m0\"/>";
  for (int i = 0; i < 100000; ++i) {
    chain +=
        "<bsdf type=\"mask\" id=\"m" + std::to_string(i + 1) + "\"><ref id=\"m" + std::to_string(i) + "\"/></bsdf>";
  }
  bad("<shape type=\"sphere\"><ref id=\"m100000\"/></shape>" + chain, "nested more than 64 deep");
  bad("<emitter type=\"constant\"><texture type=\"mesh_attribute\" name=\"radiance\"><string name=\"name\" value=\"vertex_color\"/></texture></emitter>",
      "shows nothing here");
  bad("<bsdf type=\"mask\" id=\"m\"><texture type=\"mesh_attribute\" name=\"opacity\"><string name=\"name\" value=\"vertex_weight\"/></texture>"
      "<bsdf type=\"diffuse\"><texture type=\"checkerboard\" name=\"reflectance\"/></bsdf></bsdf>"
      "<shape type=\"ply\"><string name=\"filename\" value=\"m.ply\"/><ref id=\"m\"/></shape>",
      "together with a bitmap or checkerboard");
  folder_.write(
      "m.ply",
      "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nproperty float w_0\nproperty float w_1\n"
      "element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0 1 1\n1 0 0 1 1\n0 1 0 1 1\n3 0 1 2\n");
  bad(shape("vertex_w"), "has two channels");
}

// A material that was made for a shape which then failed is made again for the next.
TEST_F(AttributesTest, MaterialsOfFailedShapesAreNotUsedAgain) {
  const std::string lost = "<shape type=\"ply\"><string name=\"filename\" value=\"none.ply\"/><ref id=\"m\"/></shape>";
  const std::string there = "<shape type=\"ply\"><string name=\"filename\" value=\"m.ply\"/><ref id=\"m\"/></shape>";
  const std::string material =
      "<bsdf type=\"diffuse\" id=\"m\"><texture type=\"mesh_attribute\" name=\"reflectance\">"
      "<string name=\"name\" value=\"vertex_weight\"/></texture></bsdf>";
  for (const std::string& first : {lost, std::string("<shape type=\"sphere\"><ref id=\"m\"/></shape>")}) {
    LoadOptions options;
    options.permissive = true;
    const Scene scene = load_scene(folder_.write("s.xml", "<scene version=\"3.0.0\"><sensor type=\"perspective\"/>\n" +
                                                              material + first + there + "</scene>"),
                                   options);
    ASSERT_FALSE(scene.shapes.empty());
    const int texture = scene.materials[static_cast<std::size_t>(scene.shapes.back().material)].reflectance;
    EXPECT_FALSE(scene.textures[static_cast<std::size_t>(texture)].pixels.empty());
  }
}

// Files that several shapes name are read once; what each makes of them is its own.
TEST_F(AttributesTest, FilesAreShared) {
  const std::string small = "<transform name=\"to_world\"><scale value=\"0.5\"/></transform>";
  const std::string mesh = "<shape type=\"ply\"><string name=\"filename\" value=\"m.ply\"/>";
  const Scene scene =
      load(mesh + "</shape>" + shape("face_tint_color") + mesh + small + "</shape>" + mesh + "</shape>");
  ASSERT_EQ(scene.meshes.size(), 4u);
  EXPECT_EQ(scene.meshes[0].positions, scene.meshes[3].positions);
  EXPECT_EQ(scene.meshes[0].normals, scene.meshes[3].normals);
  EXPECT_EQ(scene.meshes[2].positions.at(1), Vec3f(0.5f, 0, 0));
  folder_.write("m.ply", "ply\nformat");
  LoadOptions options;
  options.permissive = true;
  const std::string file =
      folder_.write("s.xml", "<scene version=\"3.0.0\"><sensor type=\"perspective\"/><shape type=\"cube\"/>\n" + mesh +
                                 "</shape>\n" + mesh + "</shape></scene>");
  EXPECT_EQ(load_scene(file, options).refused.size(), 2u);  // a mistake of each shape
}

// `merge` of Mitsuba 3.9 is a remedy for many small shapes.
TEST_F(AttributesTest, MergedShapesAreShapes) {
  const std::string two = "<shape type=\"cube\"/><shape type=\"sphere\"><emitter type=\"area\"/></shape>";
  EXPECT_EQ(load("<shape type=\"merge\">" + two + "</shape>").fingerprint, load(two).fingerprint);
}

}  // namespace
}  // namespace octrad
