// A glTF 2.0 file (.gltf with what it refers to, or .glb): its JSON, read with checks and errors that name the place,
// and its binary data. Nothing is believed before it was compared with what is there. Internal to the module.
//
// "glTF 2.0 Specification", The Khronos Group 2021 (ISO/IEC 12113:2022).
#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "octrad/scene/description.h"

namespace octrad {

class GltfFile;

// A JSON object and its path in the file, such as materials[2].pbrMetallicRoughness. One that is absent has no members.
// Members of another type than asked for, or out of range, are an InputError.
class GltfObject {
 public:
  GltfObject() = default;  // does not exist
  bool exists() const { return object_ != nullptr; }
  bool has(const std::string& key) const { return member(key) != nullptr; }
  const std::string& path() const { return path_; }
  // Of errors, with the object's name where it has one.
  Location location() const;
  [[noreturn]] void fail(const std::string& message) const { octrad::fail(location(), message); }

  GltfObject object(const std::string& key) const;
  GltfObject extension(const std::string& name) const { return object("extensions").object(name); }
  std::vector<GltfObject> objects(const std::string& key) const;
  // The object at `at` of a list; one that does not exist where the list is shorter.
  GltfObject object_at(const std::string& key, std::uint64_t at) const;
  std::vector<std::string> keys() const;
  double number(const std::string& key, double fallback, double lower = -1e30, double upper = 1e30) const;
  int integer(const std::string& key, int fallback, int lower, int upper) const;
  std::uint64_t size(const std::string& key, std::uint64_t fallback) const;
  // As many numbers as `fallback` has.
  std::vector<double> numbers(const std::string& key, std::vector<double> fallback, double lower = -1e30,
                              double upper = 1e30) const;
  std::vector<std::uint64_t> sizes(const std::string& key) const;
  std::vector<std::string> texts(const std::string& key) const;
  std::string text(const std::string& key, const std::string& fallback) const;
  // The text as the file keeps it, which may be long; empty where absent.
  const std::string& long_text(const std::string& key) const;
  bool flag(const std::string& key) const;
  // Index of an item of the file's list; -1 where absent.
  int index(const std::string& key, const std::string& list) const;

 private:
  friend class GltfFile;
  template <typename T>
  std::vector<T> list(const std::string& key, const std::string& expected,
                      bool (nlohmann::json::*is)() const noexcept) const;
  GltfObject(const GltfFile* file, const nlohmann::json* object, std::string path)
      : file_(file),
        object_(object),
        path_(std::move(path)) {}
  const nlohmann::json* member(const std::string& key) const;
  [[noreturn]] void wrong(const std::string& key, const std::string& expected) const;

  const GltfFile* file_ = nullptr;
  const nlohmann::json* object_ = nullptr;
  std::string path_;
};

// Values of an accessor: [count][components], integers as they are or, where normalised, in [0, 1] or [-1, 1].
struct GltfValues {
  std::size_t count = 0;
  int components = 0;
  std::vector<float> values;
};

class GltfFile {
 public:
  // `bytes`: the content of `file`. Files that it refers to are found by `description`.
  GltfFile(const std::string& file, std::string bytes, const Description& description);
  GltfFile(const GltfFile&) = delete;
  GltfFile& operator=(const GltfFile&) = delete;

  const std::string& name() const { return name_; }
  GltfObject root() const { return {this, &json_, ""}; }
  std::size_t count(const std::string& list) const;
  GltfObject item(const std::string& list, int index) const;  // must exist
  // Bytes of a buffer view; empty for -1.
  std::string_view view(int index) const;
  // Throws where there are others than `components` in each element.
  GltfValues values(int accessor, std::vector<int> components) const;
  std::vector<std::uint32_t> indices(int accessor) const;
  // Full name of a file that `user` refers to by a relative path.
  std::string resolve(const std::string& uri, const GltfObject& user) const;
  static bool is_data(const std::string& uri) { return uri.starts_with("data:"); }
  // The content of a data URI in base64.
  static std::string decode(const std::string& uri, const GltfObject& user);

 private:
  friend class GltfObject;
  struct Elements {
    const char* first = nullptr;
    std::size_t count = 0, stride = 0;
  };
  void read_binary(const std::string& bytes);
  void load_buffers();
  void decode_views();
  void count_read(std::uint64_t numbers, const GltfObject& accessor) const;
  void count_items(std::uint64_t items, const GltfObject& owner) const;
  // The part of a buffer that `range`, a buffer view or what stands for it, says.
  std::string_view range_of_buffer(const GltfObject& range) const;
  // `count` elements of `size` bytes from `offset` in a view, all inside.
  Elements elements(int buffer_view, std::uint64_t offset, std::uint64_t count, std::size_t size, bool packed,
                    const GltfObject& user) const;
  template <typename Each>
  void for_each_sparse(const GltfObject& accessor, std::uint64_t count, std::size_t size, Each each) const;

  std::string name_;
  const Description& description_;
  nlohmann::json json_;
  std::string binary_;                // the chunk of a .glb
  std::vector<std::string> buffers_;  // empty: of those that are not there, and of fallback
  std::vector<std::string> decoded_;  // content of buffer views that are compressed; empty for others
  std::uint64_t buffer_bytes_ = 0;
  mutable std::uint64_t numbers_read_ = 0;  // by values() and indices()
  std::uint64_t most_items_;
  mutable std::uint64_t items_read_ = 0;  // by GltfObject::objects()
};

}  // namespace octrad
