// Small glTF files for tests, made here.
#pragma once

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "octrad/base/error.h"
#include "octrad/base/folder_test_helper.h"
#include "octrad/image/io.h"
#include "octrad/scene/load.h"
#include "octrad/scene/texture.h"

namespace octrad {

template <typename T>
std::string gltf_bytes(std::initializer_list<T> values) {
  return {reinterpret_cast<const char*>(values.begin()), values.size() * sizeof(T)};
}

inline std::string gltf_base64(const std::string& bytes) {
  static const char* digits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string out;
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    std::uint32_t bits = 0;
    for (std::size_t k = 0; k < 3; ++k)
      bits = bits << 8 | (i + k < bytes.size() ? static_cast<std::uint8_t>(bytes[i + k]) : 0u);
    for (std::size_t k = 0; k < 4; ++k) out += i + k > bytes.size() ? '=' : digits[bits >> (18 - 6 * k) & 63];
  }
  return out;
}

class GltfTest : public ::testing::Test {
 protected:
  using Json = nlohmann::json;
  GltfTest() {
    json_ = Json::parse(R"({"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
      "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}], "accessors": [], "bufferViews": []})");
    // A triangle, seen by u to the right and v down the picture.
    add("VEC3", 5126, 3, gltf_bytes<float>({0, 0, 0, 1, 0, 0, 0, 1, 0}));
  }
  // An accessor over bytes of its own; returns its index.
  int add(const std::string& type, int component, int count, const std::string& bytes, Json more = Json::object()) {
    Json accessor = {{"type", type}, {"componentType", component}, {"count", count}, {"bufferView", view(bytes)}};
    accessor.update(more);
    json_["accessors"].push_back(accessor);
    return static_cast<int>(json_["accessors"].size()) - 1;
  }
  int view(const std::string& bytes) {
    while (binary_.size() % 4 != 0) binary_ += '\0';
    json_["bufferViews"].push_back({{"buffer", 0}, {"byteOffset", binary_.size()}, {"byteLength", bytes.size()}});
    binary_ += bytes;
    return static_cast<int>(json_["bufferViews"].size()) - 1;
  }
  Json& primitive() { return json_["meshes"][0]["primitives"][0]; }
  std::string write(bool container = false) {
    json_["buffers"] = {{{"byteLength", binary_.size()}}};
    for (const Json& buffer : more_buffers_) json_["buffers"].push_back(buffer);
    if (!container) {
      json_["buffers"][0]["uri"] = "data:application/octet-stream;base64," + gltf_base64(binary_);
      return folder_.write("s.gltf", json_.dump());
    }
    std::string text = json_.dump(), binary = binary_;
    text.resize((text.size() + 3) / 4 * 4, ' ');
    binary.resize((binary.size() + 3) / 4 * 4, '\0');
    const auto number = [](std::size_t v) { return gltf_bytes<std::uint32_t>({static_cast<std::uint32_t>(v)}); };
    return folder_.write("s.glb", "glTF" + number(2) + number(28 + text.size() + binary.size()) + number(text.size()) +
                                      "JSON" + text + number(binary.size()) + std::string("BIN\0", 4) + binary);
  }
  Scene load(bool permissive = false) {
    LoadOptions options;
    options.permissive = permissive;
    return load_scene(write(), options);
  }
  std::string error() {
    try {
      load();
    } catch (const InputError& e) {
      return e.what();
    }
    return "";
  }
  // A picture of one pixel.
  void add_picture(int r, int g, int b) {
    Image8 picture(1, 1, 3);
    picture.data = {static_cast<std::uint8_t>(r), static_cast<std::uint8_t>(g), static_cast<std::uint8_t>(b)};
    write_image(folder_.file("a b.png"), picture);
    json_["images"] = {{{"uri", "a%20b.png"}}};
    json_["textures"] = {{{"source", 0}}};
    primitive()["attributes"]["TEXCOORD_0"] = add("VEC2", 5126, 3, gltf_bytes<float>({0, 1, 1, 1, 0, 0}));
    primitive()["material"] = 0;
  }
  static Vec3f value(const Scene& scene, int texture) {
    return evaluate_texture(texture_view(scene.textures[static_cast<std::size_t>(texture)]), {0.3f, 0.4f});
  }
  static const Material& material(const Scene& scene) {
    return scene.materials[static_cast<std::size_t>(scene.shapes[0].material)];
  }

  TestFolder folder_;
  Json json_, more_buffers_ = Json::array();
  std::string binary_;
};

}  // namespace octrad
