// Serialized meshes of both versions and precisions, several in a file; damaged ones.
#include <gtest/gtest.h>
#include <zlib.h>

#include <cstring>

#include "octrad/base/error.h"
#include "octrad/scene/mesh.h"

namespace octrad {
namespace {

template <typename T>
void put(std::string& out, T value) {
  out.append(reinterpret_cast<const char*>(&value), sizeof value);
}

std::string compress(const std::string& bytes) {
  uLongf size = compressBound(static_cast<uLong>(bytes.size()));
  std::string out(size, '\0');
  EXPECT_EQ(compress2(reinterpret_cast<Bytef*>(out.data()), &size, reinterpret_cast<const Bytef*>(bytes.data()),
                      static_cast<uLong>(bytes.size()), 6),
            Z_OK);
  out.resize(size);
  return out;
}

constexpr std::uint32_t kNormals = 1, kUvs = 2, kColors = 8, kSingle = 0x1000, kDouble = 0x2000;

std::string content(std::uint32_t flags, int version, float height, std::uint32_t corner = 3,
                    std::uint64_t vertices = 4, std::uint64_t triangles = 2) {
  std::string out;
  put(out, flags);
  if (version == 4) out += std::string("mesh") + '\0';
  put(out, vertices);
  put(out, triangles);
  const auto numbers = [&](std::initializer_list<float> values) {
    for (const float v : values) {
      if (flags & kDouble) put(out, static_cast<double>(v));
      else put(out, v);
    }
  };
  numbers({0, 0, height, 1, 0, height, 1, 1, height, 0, 1, height});
  if (flags & kNormals) numbers({0, 0, 1, 0, 0.5f, 1, 0, 0, 1, 0, 0, 1});
  if (flags & kUvs) numbers({0, 0, 1, 0, 1, 1, 0, 0.25f});
  if (flags & kColors) numbers({1, 0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 0});
  for (const std::uint32_t i : {0u, 1u, 2u, 0u, 2u, corner}) put(out, i);
  return out;
}

std::string file_of(const std::vector<std::string>& contents, int version) {
  std::string out;
  std::vector<std::size_t> offsets;
  for (const std::string& c : contents) {
    offsets.push_back(out.size());
    put(out, std::uint16_t{0x041c});
    put(out, static_cast<std::uint16_t>(version));
    out += compress(c);
  }
  for (const std::size_t offset : offsets) {
    if (version == 4) put(out, static_cast<std::uint64_t>(offset));
    else put(out, static_cast<std::uint32_t>(offset));
  }
  put(out, static_cast<std::uint32_t>(offsets.size()));
  return out;
}

TEST(Serialized, VersionsPrecisionsAndSeveralMeshes) {
  for (const int version : {3, 4}) {
    for (const std::uint32_t flags : {kSingle, kSingle | kNormals | kUvs, kDouble | kUvs | kColors,
                                      kDouble | kNormals | kColors, std::uint32_t{0}}) {
      const std::string file = file_of(
          {content(flags, version, 1.0f), content(flags, version, 2.0f), content(flags, version, 3.0f)}, version);
      for (int index = 0; index < 3; ++index) {
        const RawMesh mesh = parse_serialized("a.serialized", file, index);
        ASSERT_EQ(mesh.positions.size(), 4u);
        EXPECT_EQ(mesh.positions[2], Vec3f(1, 1, static_cast<float>(index + 1)));
        ASSERT_EQ(mesh.triangles.size(), 2u);
        EXPECT_EQ(mesh.triangles[1], Vec3i(0, 2, 3));
        ASSERT_EQ(mesh.normals.size(), flags & kNormals ? 4u : 0u);
        if (flags & kNormals) {
          EXPECT_EQ(mesh.normals[1], Vec3f(0, 0.5f, 1));
        }
        ASSERT_EQ(mesh.uvs.size(), flags & kUvs ? 4u : 0u);
        if (flags & kUvs) {
          EXPECT_EQ(mesh.uvs[3].y, 0.25f);
        }
      }
    }
  }
}

std::string damage_of(const std::string& bytes, int index = 0) {
  try {
    parse_serialized("a.serialized", bytes, index);
  } catch (const InputError& e) {
    return e.what();
  }
  return "";
}

TEST(Serialized, NormalsAndUvsThatAreNotFiniteAreNone) {
  std::string bytes = content(kSingle | kNormals | kUvs, 4, 1.0f);
  const float nan = std::nanf("");
  constexpr std::size_t kHead = 4 + 5 + 16, kPositions = 4 * 3 * 4;
  std::memcpy(&bytes[kHead + kPositions + 4], &nan, sizeof nan);      // y of the first normal
  std::memcpy(&bytes[kHead + 2 * kPositions + 8], &nan, sizeof nan);  // u of the second vertex
  const RawMesh mesh = parse_serialized("a.serialized", file_of({bytes}, 4), 0);
  EXPECT_EQ(mesh.normals[0], Vec3f(0.0f));
  EXPECT_EQ(mesh.normals[1], Vec3f(0, 0.5f, 1));
  EXPECT_EQ(mesh.uvs[1], (Vec2f{0, 0}));
  EXPECT_EQ(mesh.uvs[2], (Vec2f{1, 1}));
}

TEST(Serialized, DamageIsNamed) {
  const auto says = [](const std::string& found, const std::string& text) {
    EXPECT_NE(found.find("a.serialized:1:"), std::string::npos) << found;
    EXPECT_NE(found.find(text), std::string::npos) << found;
  };
  const std::string good = file_of({content(kSingle, 4, 1.0f)}, 4);
  says(damage_of(""), "not a serialized mesh");
  says(damage_of("ply\nformat ascii 1.0\n"), "not a serialized mesh");
  std::string other = good;
  other[2] = 5;
  says(damage_of(other), "version 5 are not supported; supported: 3, 4");
  says(damage_of(good, 1), "shape_index 1: the file holds 1 meshes");
  says(damage_of(good.substr(0, 10)), "ends early");
  std::string beyond = good;
  beyond[good.size() - 5] = '\x80';  // the first mesh's place in the table
  says(damage_of(beyond), "mesh 0 begins outside of the file");
  says(damage_of(good.substr(0, good.size() - 2) + "\xff\xff"), "no table of its meshes");
  says(damage_of(file_of({content(kSingle, 4, 1.0f).substr(0, 60)}, 4)), "ends early");
  says(damage_of(file_of({content(kSingle, 4, 1.0f, 4)}, 4)), "refers to vertex 4, but there are 4");
  says(damage_of(file_of({content(kSingle, 4, 1.0f, 3, std::uint64_t{1} << 27)}, 4)), "announces 134217728 vertices");
  says(damage_of(file_of({content(kSingle, 4, 1.0f, 3, std::uint64_t{1} << 60)}, 4)), "too many vertices");
  says(damage_of(file_of({content(kSingle, 4, 1.0f, 3, 0)}, 4)), "refers to vertex 0, but there are 0");
  EXPECT_TRUE(parse_serialized("a.serialized", file_of({content(kSingle, 4, 1.0f, 3, 4, 0)}, 4), 0).triangles.empty());
  says(damage_of(file_of({content(kSingle, 4, std::nanf(""))}, 4)), "a position is not finite");
  for (std::size_t i = 0; i < good.size(); ++i) {  // whatever bit is wrong: a mesh or a sentence
    std::string damaged = good;
    damaged[i] = static_cast<char>(damaged[i] ^ (1 << (i % 8)));
    try {
      parse_serialized("a.serialized", damaged, 0);
    } catch (const Error&) {
    }
  }
}

}  // namespace
}  // namespace octrad
