// OBJ and PLY readers, vertex normals and placement; expected numbers where given are Mitsuba 3.9.1's.
#include "octrad/scene/mesh.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cstring>

#include "octrad/base/error.h"
#include "octrad/base/rng.h"

namespace octrad {
namespace {

const std::string kQuad = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0.5\nv 0.5 1.5 0\n";

RawMesh obj(const std::string& text) { return parse_obj("a.obj", text); }
TriangleMesh placed(RawMesh raw, const MeshOptions& options = {}, const Transform& t = {}) {
  return place_mesh(std::move(raw), t, options);
}

std::string error_of(const std::string& text, bool ply = false) {
  try {
    ply ? parse_ply("a.ply", text) : parse_obj("a.obj", text);
  } catch (const InputError& error) {
    return error.what();
  }
  return "no error";
}

void expect_normals(const std::vector<Vec3f>& found, const std::vector<Vec3f>& expected) {
  ASSERT_EQ(found.size(), expected.size());
  for (std::size_t i = 0; i < found.size(); ++i)
    EXPECT_LT(length(found[i] - expected[i]), 3e-6f)
        << i << ": " << found[i].x << " " << found[i].y << " " << found[i].z;
}

TEST(Obj, PolygonsBecomeFansWithSmoothNormals) {
  const TriangleMesh mesh = placed(obj(kQuad + "f 1 2 3 4 5\n"));
  EXPECT_EQ(mesh.triangles, (std::vector<Vec3i>{{0, 1, 2}, {0, 2, 3}, {0, 3, 4}}));
  expect_normals(mesh.normals, {{-0.069246285f, -0.17261216f, 0.98255277f},
                                {0, 0, 1},
                                {0.2270461f, -0.2270461f, 0.94704807f},
                                {-0.98573756f, -0.07526156f, 0.15052313f},
                                {-0.8017837f, 0.26726124f, -0.5345225f}});
  EXPECT_TRUE(mesh.uvs.empty());
}

TEST(Obj, NormalsBreakWhereTextureCoordinatesDo) {
  // Vertices are told apart by all their indices, so a seam in uv is a crease.
  const TriangleMesh mesh =
      placed(obj(kQuad + "vt 0.1 0.2\nvt 0.3 0.4\nvt 0.5 0.6\nf 1/1 2/2 3/3\nf 1/2 3/3 4/1\n"), {.flip_v = true});
  ASSERT_EQ(mesh.positions.size(), 5u);
  EXPECT_EQ(mesh.triangles[1], (Vec3i{3, 2, 4}));
  EXPECT_LT(length(mesh.normals[0] - Vec3f(0, 0, 1)), 1e-6f);
  EXPECT_LT(length(mesh.normals[2] - Vec3f(0.2270461f, -0.2270461f, 0.94704807f)), 1e-6f);
  EXPECT_FLOAT_EQ(mesh.uvs[0].y, 0.8f);
  EXPECT_FLOAT_EQ(mesh.uvs[2].x, 0.5f);
}

// A vertex with very many texture coordinates: each of them becomes one vertex, however often it is met.
TEST(Obj, VerticesAreSharedAmongMany) {
  constexpr int kCoordinates = 500;
  std::string text = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";
  for (int i = 0; i < kCoordinates; ++i) text += "vt 0." + std::to_string(1000 + i) + " 0\n";
  for (int round = 0; round < 2; ++round) {
    for (int i = 1; i <= kCoordinates; ++i) text += "f 1/" + std::to_string(i) + " 2/1 3/1\n";
  }
  const RawMesh mesh = obj(text);
  ASSERT_EQ(mesh.positions.size(), static_cast<std::size_t>(kCoordinates + 2));
  ASSERT_EQ(mesh.triangles.size(), static_cast<std::size_t>(2 * kCoordinates));
  for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
    const auto corner = static_cast<std::size_t>(mesh.triangles[i].x);
    EXPECT_EQ(mesh.triangles[i], mesh.triangles[i % kCoordinates]);
    EXPECT_EQ(mesh.positions[corner], Vec3f(0, 0, 0));
    EXPECT_NEAR(mesh.uvs[corner].x, 0.1f + 1e-4f * static_cast<float>(i % kCoordinates), 1e-6f);
  }
}

TEST(Obj, NormalsAreComputedInWorldSpace) {
  const TriangleMesh mesh = placed(obj(kQuad + "f 1 2 3\nf 1 3 4\n"), {}, Transform::scale({-1, 2, 1}));
  expect_normals(mesh.normals, {{0.1435356f, 0.0717678f, -0.98703957f},
                                {0, 0, -1},
                                {0.32016897f, 0.16008449f, -0.93373704f},
                                {0.43643576f, 0.21821788f, -0.8728715f}});
  EXPECT_TRUE(placed(obj(kQuad + "f 1 2 3\n"), {.face_normals = true}).normals.empty());
}

TEST(Obj, DegenerateTrianglesGiveNoWeight) {
  expect_normals(placed(obj(kQuad + "f 1 2 2\nf 1 2 3\n")).normals, {{0, 0, 1}, {0, 0, 1}, {0, 0, 1}});
  expect_normals(placed(obj(kQuad + "f 1 2 2\n")).normals, {{1, 0, 0}, {1, 0, 0}});
}

TEST(Obj, FileNormalsAreCarriedByTheInverseTranspose) {
  const std::string text = kQuad + "vn 0 0 2\nvn 0 1 2\nf 1//1 2//2 3//1\n";
  const TriangleMesh mesh = placed(obj(text), {}, Transform::scale({2, -1, 1}));
  expect_normals(mesh.normals, {{0, 0, 1}, {0, -0.44721362f, 0.89442724f}, {0, 0, 1}});
  // Mirrored: the triangle is turned so that it still faces where its normals point.
  const Vec3i t = mesh.triangles[0];
  const Vec3f n = cross(mesh.positions[static_cast<std::size_t>(t.y)] - mesh.positions[static_cast<std::size_t>(t.x)],
                        mesh.positions[static_cast<std::size_t>(t.z)] - mesh.positions[static_cast<std::size_t>(t.x)]);
  EXPECT_GT(n.z, 0.0f);
  // Where the file has the normals behind the triangles, what mirrors brings them together.
  const TriangleMesh behind = placed(obj(kQuad + "vn 0 0 -1\nf 1//1 2//1 3//1\n"), {}, Transform::scale({-1, 1, 1}));
  EXPECT_EQ(behind.triangles[0], Vec3i(0, 1, 2));
  EXPECT_TRUE(behind.flat);
}

TEST(Mesh, FlatWhereNormalsAreThoseOfTheFaces) {
  const Transform mirrored = Transform::scale({-2, 1, 3}), tiny = Transform::scale({1e-12, 1e-12, 1e-12});
  for (const Transform& t : {Transform(), mirrored, tiny}) {
    EXPECT_TRUE(placed(make_cube(), {}, t).flat);
    EXPECT_TRUE(placed(make_cube(), {.flip_normals = true}, t).flat);
    EXPECT_TRUE(placed(make_rectangle(), {}, t).flat);
    EXPECT_TRUE(placed(obj(kQuad + "f 1 2 3\nf 1 2 2\n"), {}, t).flat) << "a triangle without area has no normal";
    EXPECT_FALSE(placed(obj(kQuad + "f 1 2 3\nf 1 3 4\n"), {}, t).flat) << "a bent edge";
    EXPECT_FALSE(placed(obj(kQuad + "vn 0 0.001 1\nf 1//1 2//1 3//1\n"), {}, t).flat);
    EXPECT_EQ(placed(obj(kQuad + "vn 0 0 -1\nf 1//1 2//1 3//1\n"), {}, t).flat, t.determinant() < 0.0)
        << "normals say the other side, unless it is mirrored";
  }
  EXPECT_FALSE(placed(obj(kQuad + "f 1 2 3\n"), {.face_normals = true}).flat) << "there are no normals";
}

TEST(Obj, MissingNormalsAreComputed) {
  const TriangleMesh mesh = placed(obj(kQuad + "vn 0 1 0\nf 1//1 2//1 3//1\nf 1 3 4\n"));
  ASSERT_EQ(mesh.normals.size(), 6u);
  EXPECT_EQ(mesh.normals[0], Vec3f(0, 1, 0));
  EXPECT_LT(length(mesh.normals[3] - Vec3f(0.40824828f, -0.40824828f, 0.81649655f)), 1e-6f);
  // A zero normal counts as missing.
  EXPECT_LT(length(placed(obj(kQuad + "vn 0 0 0\nf 1//1 2//1 3//1\n")).normals[1] - Vec3f(0, 0, 1)), 1e-6f);
}

TEST(Obj, SyntaxVariants) {
  // Negative indices, CRLF, tabs, comments, continuation, w and colours, groups, exponents, plus signs, no final
  // newline.
  const RawMesh mesh = obj(
      "# x\r\nmtllib a.mtl\r\no a\r\nv\t0 0 0 1 0.5 0.5\r\nv +1e0 0 0 1.0\r\nv 1 1.0E+0 -0 # c\r\n\r\ng b\ns off\nusemtl x\nvp 1 2\nl 1 2\nf -3 \\\n -2 -1");
  ASSERT_EQ(mesh.triangles.size(), 1u);
  EXPECT_EQ(mesh.positions[1], Vec3f(1, 0, 0));
  EXPECT_EQ(mesh.positions[2], Vec3f(1, 1, 0));
  // An index of 0 for none, faces without an area, and coordinates that are no numbers, which Mitsuba takes.
  EXPECT_EQ(obj("\xef\xbb\xbfv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").positions.size(), 3u) << "a byte order mark";
  const RawMesh bare = obj("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1/0/0 2/0 3//0\nf 1 2\n");
  EXPECT_EQ(bare.triangles.size(), 1u);
  EXPECT_TRUE(bare.uvs.empty() && bare.normals.empty());
  EXPECT_EQ(obj("v 0 0 0\nv 1 0 0\nv 0 1 0\nvt nan 0.25\nf 1/1 2/1 3/1\n").uvs[0], (Vec2f{0, 0.25f}));
  EXPECT_EQ(obj("v 1e-60 0 0\nv 1 0 0\nv 0 1 0\nvt 0.5\nf 1/1/ 2/1 3/1").uvs[0].x, 0.5f);
}

// Faces may come before what they are made of; negative indices count from where they stand.
TEST(Obj, VerticesAfterFaces) {
  const RawMesh mesh =
      obj("v 0 0 0\nv 1 0 0\nf 1/2/1 2/1/1 3/3/1\nv 0 1 0\nvt 0 0\nvt 1 0\nf -3/-1 -2 -1\nvt 0 1\nvn 0 0 1\nv 5 5 5\n"
          "f 4 -2 -1\n");
  ASSERT_EQ(mesh.triangles.size(), 3u);
  const auto corner = [&](int triangle, int i) {
    return static_cast<std::size_t>(mesh.triangles[static_cast<std::size_t>(triangle)][i]);
  };
  EXPECT_EQ(mesh.positions[corner(0, 2)], Vec3f(0, 1, 0));
  EXPECT_EQ(mesh.uvs[corner(0, 0)], (Vec2f{1, 0}));
  EXPECT_EQ(mesh.uvs[corner(0, 2)], (Vec2f{0, 1}));
  EXPECT_EQ(mesh.normals[corner(0, 1)], Vec3f(0, 0, 1));
  EXPECT_EQ(mesh.positions[corner(1, 0)], Vec3f(0, 0, 0));
  EXPECT_EQ(mesh.uvs[corner(1, 0)], (Vec2f{1, 0}));  // the second of two so far
  EXPECT_EQ(mesh.positions[corner(2, 0)], Vec3f(5, 5, 5));
  EXPECT_EQ(mesh.positions[corner(2, 1)], Vec3f(0, 1, 0));
  EXPECT_EQ(error_of("v 0 0 0\nf 1 2 3\nv 1 0 0\n"), "a.obj:2:7: face: there is no vertex 3 (the file has 2)");
  EXPECT_EQ(error_of("v 0 0 0\nf 1 -2 1\nv 1 0 0\n"),
            "a.obj:2:5: face: there is no vertex -2 (the file has 1, 1 so far)");
  EXPECT_EQ(error_of("v 0 0 0\nf 1 2 1\nv 1 x 0\n"), "a.obj:3:5: vertex: expected a number");
}

TEST(Obj, ErrorsSayWhere) {
  EXPECT_EQ(error_of(kQuad + "f 1 2 9\n"), "a.obj:6:7: face: there is no vertex 9 (the file has 5)");
  EXPECT_EQ(error_of(kQuad + "f 0 1 2\n"), "a.obj:6:3: face: there is no vertex 0 (the file has 5)");
  EXPECT_EQ(error_of(kQuad + "f -6 1 2\n"), "a.obj:6:3: face: there is no vertex -6 (the file has 5, 5 so far)");
  EXPECT_EQ(error_of(kQuad + "f 1/1 2 3\n"), "a.obj:6:5: face: there is no texture vertex 1 (the file has 0)");
  EXPECT_EQ(error_of(kQuad + "f 1//2 2 3\n"), "a.obj:6:6: face: there is no vertex normal 2 (the file has 0)");
  EXPECT_TRUE(obj("v 0 0 0\nv 1 0 0\nf 1 2\n").triangles.empty());
  EXPECT_EQ(error_of(kQuad + "f 1 2 x\n"), "a.obj:6:7: face: expected the index of a vertex");
  EXPECT_EQ(error_of(kQuad + "f 1 2 3x\n"), "a.obj:6:8: face: expected a blank after the corner");
  EXPECT_EQ(error_of("v 0 0\n"), "a.obj:1:6: vertex: expected a number");
  EXPECT_EQ(error_of("v 0 nan 0\n"), "a.obj:1:5: vertex: the number is not finite");
  for (const char* large : {"1e99", "-1e999", "1e99999"})
    EXPECT_EQ(error_of("v 0 " + std::string(large) + " 0\n"), "a.obj:1:5: vertex: the number is not finite");
  EXPECT_EQ(error_of(kQuad + "v 1e-999 1e-50 0\nf 1 2 6\n"), "no error");
  EXPECT_EQ(error_of("v 0 0,1 0\n"), "a.obj:1:6: vertex: expected a blank after the number");
  EXPECT_EQ(error_of("f 99999999999 1 1\n"), "a.obj:1:3: face: expected the index of a vertex");
  EXPECT_EQ(error_of("# nothing\n"), "a.obj:1:1: the OBJ file holds no vertex");
  EXPECT_EQ(error_of(""), "a.obj:1:1: the OBJ file holds no vertex");
}

// PLY -------------------------------------------------------------------------------------------------------------

std::string header(const std::string& format, const std::string& vertex_properties, int vertices, int faces,
                   const std::string& list = "list uchar int vertex_indices") {
  std::string text = "ply\nformat " + format + " 1.0\ncomment x\nelement vertex " + std::to_string(vertices) + "\n";
  for (const char* p = vertex_properties.c_str(); *p;) {
    const char* end = std::strchr(p, ' ');
    const std::string name = end ? std::string(p, end) : std::string(p);
    text += "property float " + name + "\n";
    p = end ? end + 1 : p + name.size();
  }
  return text + "element face " + std::to_string(faces) + "\nproperty " + list + "\nend_header\n";
}

template <typename T>
void put(std::string& bytes, T value, bool big) {
  char buffer[sizeof(T)];
  std::memcpy(buffer, &value, sizeof(T));
  if (big != (std::endian::native == std::endian::big)) std::reverse(buffer, buffer + sizeof(T));
  bytes.append(buffer, sizeof(T));
}

// Two triangles over four vertices with normals and uv.
std::string binary_ply(bool big) {
  std::string bytes = header(big ? "binary_big_endian" : "binary_little_endian", "x y z nx ny nz s t", 4, 1);
  const float corners[4][2] = {{0, 0}, {1, 0}, {1, 1}, {0, 1}};
  for (const auto& c : corners) {
    for (const float v : {c[0], c[1], 0.25f, 0.0f, 0.0f, 2.0f, c[0], 0.5f * c[1]}) put(bytes, v, big);
  }
  put<std::uint8_t>(bytes, 4, big);
  for (int i = 0; i < 4; ++i) put(bytes, i, big);
  return bytes;
}

TEST(Ply, BinaryOfBothByteOrdersAndAsciiAgree) {
  const std::string ascii =
      header("ascii", "x y z nx ny nz u v", 4, 1) +
      "0 0 .25 0 0 2 0 0\n1 0 0.25 0 0 2 1 0\n1 1 +0.25 0 0 2 1 0.5\n0 1 2.5e-1 0 0 2 0 0.5\n4 0 1 2 3\n";
  const RawMesh expected = parse_ply("a.ply", binary_ply(false));
  EXPECT_EQ(expected.triangles, (std::vector<Vec3i>{{0, 1, 2}, {0, 2, 3}}));
  EXPECT_EQ(expected.positions[2], Vec3f(1, 1, 0.25f));
  EXPECT_EQ(expected.uvs[3], (Vec2f{0, 0.5f}));
  EXPECT_EQ(expected.normals[0], Vec3f(0, 0, 2));
  for (const std::string& other : {binary_ply(true), ascii}) {
    const RawMesh mesh = parse_ply("b.ply", other);
    EXPECT_EQ(mesh.positions, expected.positions);
    EXPECT_EQ(mesh.normals, expected.normals);
    EXPECT_EQ(mesh.uvs, expected.uvs);
    EXPECT_EQ(mesh.triangles, expected.triangles);
  }
  expect_normals(placed(parse_ply("a.ply", binary_ply(false))).normals, std::vector<Vec3f>(4, Vec3f(0, 0, 1)));
}

TEST(Ply, OtherElementsAndPropertiesAreSkipped) {
  const RawMesh mesh = parse_ply(
      "a.ply",
      "ply\r\nformat ascii 1.0\r\nelement material 1\r\nproperty list uchar float c\r\nproperty int q\r\nelement face 1\r\n"
      "property uchar flag\r\nproperty list ushort uint vertex_index\r\nproperty list uchar float tex\r\nelement vertex 3\r\n"
      "property double z\r\nproperty uchar red\r\nproperty float x\r\nproperty float y\r\nelement edge 1\r\nproperty int a\r\nend_header\r\n"
      "2 0.5 0.5 7\r\n9 3 0 1 2 6 0 0 0 0 0 0\r\n5 255 0 0\r\n6 0 1 0\r\n7 0 0 1\r\n3\r\n");
  EXPECT_EQ(mesh.triangles, (std::vector<Vec3i>{{0, 1, 2}}));
  EXPECT_EQ(mesh.positions[1], Vec3f(1, 0, 6));
}

TEST(Ply, StripsOfTriangles) {
  const std::string head =
      "ply\nformat ascii 1.0\nelement vertex 6\nproperty float x\nproperty float y\nproperty float z\n"
      "element tristrips 1\nproperty list int int vertex_indices\nend_header\n"
      "0 0 0\n1 0 0\n0 1 0\n1 1 0\n0 2 0\n5 5 5\n";
  const RawMesh mesh = parse_ply("t.ply", head + "12 0 1 2 3 4 -1 2 1 -1 3 4 5\n");
  const std::vector<Vec3i> expected = {{0, 1, 2}, {2, 1, 3}, {2, 3, 4}, {3, 4, 5}};
  EXPECT_EQ(mesh.triangles, expected) << "all on the same side, and none of a strip of two";
  std::string other = head;
  other.replace(other.find("element tris"), 0, "element face 0\nproperty list uchar int vertex_indices\n");
  other.replace(other.rfind("vertex_indices"), 14, "vertex_index");
  EXPECT_EQ(parse_ply("t.ply", other + "3 0 1 2\n").triangles, (std::vector<Vec3i>{{0, 1, 2}}));
  EXPECT_NE(error_of(head + "3 0 1 6\n", true).find("vertex 6, but there are 6"), std::string::npos);
  EXPECT_NE(error_of(head + "3 0 1 3000000000\n", true).find("a strip of triangles refers to vertex 3000000000"),
            std::string::npos);
  EXPECT_NE(error_of(head + "99 0 1\n", true).find("does not fit"), std::string::npos);
}

TEST(Ply, NormalsAsMitsuba) {
  const std::string rows = "0 0 0\n1 0 0\n1 1 0\n0 1 0.5\n0.5 1.5 0\n3 0 1 2\n3 0 2 3\n";
  expect_normals(placed(parse_ply("a.ply", header("ascii", "x y z", 5, 2) + rows)).normals,
                 {{0.2270461f, -0.2270461f, 0.94704807f},
                  {0, 0, 1},
                  {0.2270461f, -0.2270461f, 0.94704807f},
                  {0.40824828f, -0.40824828f, 0.81649655f},
                  {1, 0, 0}});
  const std::string with =
      "0 0 0 0 0 2\n1 0 0 0 0 2\n1 1 0 1 1 2\n0 1 0.5 0 1 2\n0.5 1.5 0 0.5 1 2\n3 0 1 2\n3 0 2 3\n";
  expect_normals(
      placed(parse_ply("a.ply", header("ascii", "x y z nx ny nz", 5, 2) + with), {}, Transform::scale({2, 1, 1}))
          .normals,
      {{0, 0, 1},
       {0, 0, 1},
       {0.2182179f, 0.4364358f, 0.8728716f},
       {0, 0.44721362f, 0.89442724f},
       {0.1111111f, 0.44444442f, 0.88888884f}});
}

TEST(Ply, ErrorsSayWhatIsWrong) {
  const std::string xyz = header("ascii", "x y z", 3, 1), rows = "0 0 0\n1 0 0\n0 1 0\n";
  const auto has = [](const std::string& text, const std::string& expected) {
    const std::string error = error_of(text, true);
    EXPECT_NE(error.find(expected), std::string::npos) << error;
    EXPECT_EQ(error.rfind("a.ply:", 0), 0u) << error;
  };
  has("", "header ends before end_header");
  has("plx\n", "not a PLY file");
  has("ply\nformat binary 1.0\n", "unknown PLY format \"binary\"");
  has("ply\nformat ascii 1.0\nelement vertex -3\n", "\"-3\" is not a number of elements");
  has("ply\nformat ascii 1.0\nelement vertex 3\nproperty half x\n", "unknown PLY type \"half\"");
  has("ply\nformat ascii 1.0\nelement vertex 3\nproperty list float int x\n", "must have an integer type");
  has("ply\nformat ascii 1.0\nnonsense\n", "unknown PLY header line");
  has("ply\nend_header\n", "no format line");
  has("ply\nformat ascii 1.0\nend_header\n", "no element \"vertex\"");
  has(header("ascii", "x y", 3, 1) + "0 0\n0 0\n0 0\n3 0 1 2\n", "lacks x, y or z");
  has(header("ascii", "x y z", 3, 1, "list uchar int corners") + rows + "3 0 1 2\n", "lacks the list vertex_indices");
  has(xyz + rows + "3 0 1 3\n", "refers to vertex 3, but there are 3");
  has(xyz + rows + "3 0 1 -1\n", "refers to vertex -1");
  has(xyz + rows + "3 0 1 0.5\n", "expected an integer");
  has(xyz + rows + "3 0 1\n", "ends early");
  for (const char* value : {"nan", "1e999", "-1e99"})
    has(xyz + "0 0 " + value + "\n1 0 0\n0 1 0\n3 0 1 2\n", "not finite");
  has(xyz + "0 0 x\n1 0 0\n0 1 0\n3 0 1 2\n", "expected a number");
  has(xyz + rows + "200 0 1 2\n", "does not fit");
}

// As in OBJ files; so are their attributes.
TEST(Ply, FacesOfOneOrTwoCornersAreLeftOut) {
  const std::string text =
      "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\nelement face 5\n"
      "property float level_x\nproperty list uchar int vertex_indices\nproperty float heat_x\nend_header\n"
      "0 0 0\n1 0 0\n1 1 0\n0 1 0\n1 2 0 1 10\n2 3 0 1 2 20\n3 0 30\n4 4 0 1 2 3 40\n5 1 9 50\n";
  const RawMesh mesh = parse_ply("a.ply", text, {"face_level", "face_heat"}),
                same = parse_obj("a.obj", "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2\nf 1 2 3\nf\nf 1 2 3 4\nf 2\n");
  EXPECT_EQ(mesh.triangles, same.triangles);
  ASSERT_EQ(mesh.triangles.size(), 3u);
  ASSERT_EQ(mesh.attributes.size(), 2u);
  for (const MeshAttribute& a : mesh.attributes) {
    const float unit = a.name == "face_heat" ? 10.0f : 1.0f;
    EXPECT_EQ(a.values, (std::vector<float>{2 * unit, 4 * unit, 4 * unit})) << a.name;
  }
  EXPECT_TRUE(parse_ply("a.ply", header("ascii", "x y z", 1, 1) + "0 0 0\n1 0\n").triangles.empty());
}

TEST(Ply, NormalsAndUvsThatAreNotFiniteAreNone) {
  const RawMesh mesh = parse_ply("a.ply", header("ascii", "x y z nx ny nz u v", 3, 1) +
                                              "0 0 0 0 nan 1 nan 0.5\n1 0 0 0 0 1 1 0\n0 1 0 0 0 1 0 inf\n3 0 1 2\n");
  EXPECT_EQ(mesh.normals[0], Vec3f(0.0f));
  EXPECT_EQ(mesh.normals[1], Vec3f(0, 0, 1));
  EXPECT_EQ(mesh.uvs[0], (Vec2f{0, 0.5f}));
  EXPECT_EQ(mesh.uvs[2], (Vec2f{0, 0}));
}

TEST(Ply, HugeCountsAreRefusedBeforeAnythingIsAllocated) {
  for (const std::string count : {"4000000000", "2000000000", "18446744073709551615", "99999999999999999999"}) {
    for (const std::string format : {"ascii", "binary_little_endian"}) {
      const std::string error = error_of("ply\nformat " + format + " 1.0\nelement vertex " + count +
                                             "\nproperty float x\nproperty float y\nproperty float z\nelement face " +
                                             count + "\nproperty list uint int vertex_indices\nend_header\nabc",
                                         true);
      EXPECT_TRUE(error.find("announces") != std::string::npos || error.find("not a number") != std::string::npos)
          << error;
    }
  }
  std::string bytes = header("binary_little_endian", "x y z", 1, 1, "list uint int vertex_indices") +
                      std::string(12, '\0') + "\xff\xff\xff\xff";
  EXPECT_NE(error_of(bytes, true).find("does not fit"), std::string::npos);
}

// Truncated and corrupted files must give an InputError or a mesh, never a crash (run under the sanitizers).
TEST(MeshFuzz, TruncatedAndCorruptedFiles) {
  const std::string obj_text = kQuad + "vt 0.1 0.2\nvn 0 0 1\nf 1/1/1 2/1/1 3/1/1 4//1\nf -1 -2 -3\n";
  const std::string ply_text = header("ascii", "x y z s t", 3, 1) + "0 0 0 0 0\n1 0 0 1 0\n0 1 0 0 1\n3 0 1 2\n";
  int meshes = 0, errors = 0;
  const auto attempt = [&](const std::string& text, bool ply) {
    try {
      const TriangleMesh mesh = placed(ply ? parse_ply("a.ply", text) : parse_obj("a.obj", text));
      for (const Vec3i& t : mesh.triangles) {
        for (int i = 0; i < 3; ++i) ASSERT_LT(static_cast<std::size_t>(t[i]), mesh.positions.size());
      }
      ++meshes;
    } catch (const InputError&) {
      ++errors;
    }
  };
  for (const auto& [text, ply] : {std::make_pair(obj_text, false), std::make_pair(ply_text, true),
                                  std::make_pair(binary_ply(false), true), std::make_pair(binary_ply(true), true)}) {
    for (std::size_t n = 0; n < text.size(); ++n) attempt(text.substr(0, n), ply);
    for (std::uint64_t i = 0; i < 3000; ++i) {
      Rng rng(7, RngPurpose::test, i);
      std::string broken = text;
      for (std::uint32_t k = 0, n = 1 + rng.below(4); k < n; ++k)
        broken[rng.below(static_cast<std::uint32_t>(broken.size()))] = static_cast<char>(rng.below(256));
      attempt(broken, ply);
    }
  }
  EXPECT_GT(meshes, 100);
  EXPECT_GT(errors, 1000);
}

TEST(Shapes, RectangleAndCubeFaceOutwards) {
  for (const RawMesh& mesh : {make_rectangle(), make_cube()}) {
    double area = 0.0;
    for (const Vec3i& t : mesh.triangles) {
      const Vec3f p0 = mesh.positions[static_cast<std::size_t>(t.x)];
      const Vec3f n =
          cross(mesh.positions[static_cast<std::size_t>(t.y)] - p0, mesh.positions[static_cast<std::size_t>(t.z)] - p0);
      area += 0.5 * static_cast<double>(length(n));
      EXPECT_EQ(normalize(n), mesh.normals[static_cast<std::size_t>(t.x)]);
    }
    EXPECT_DOUBLE_EQ(area, mesh.triangles.size() == 2 ? 4.0 : 24.0);
  }
}

}  // namespace
}  // namespace octrad
