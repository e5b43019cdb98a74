#include <algorithm>
#include <bit>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <string_view>
#include <utility>

#include "octrad/base/input_file.h"
#include "octrad/base/memory_limit.h"
#include "octrad/base/read_decimal.h"
#include "octrad/image/tonemap_math.h"
#include "octrad/scene/limits.h"
#include "octrad/scene/mesh.h"
#include "octrad/scene/source.h"

namespace octrad {
namespace {

// Where the properties of vertices go: 0-2 position, 3-5 normal, 6-7 uv.
constexpr int kFirstCoordinate = 6;
constexpr std::pair<std::string_view, int> kTargets[] = {
    {"x", 0}, {"y", 1}, {"z", 2}, {"nx", 3},        {"ny", 4},        {"nz", 5},        {"u", 6},
    {"v", 7}, {"s", 6}, {"t", 7}, {"texture_u", 6}, {"texture_v", 7}, {"texture_s", 6}, {"texture_t", 7}};

enum class Type { int8, uint8, int16, uint16, int32, uint32, float32, float64 };

struct TypeName {
  const char* name;
  Type type;
};
const TypeName kTypeNames[] = {
    {"char", Type::int8},   {"uchar", Type::uint8},   {"short", Type::int16},     {"ushort", Type::uint16},
    {"int", Type::int32},   {"uint", Type::uint32},   {"float", Type::float32},   {"double", Type::float64},
    {"int8", Type::int8},   {"uint8", Type::uint8},   {"int16", Type::int16},     {"uint16", Type::uint16},
    {"int32", Type::int32}, {"uint32", Type::uint32}, {"float32", Type::float32}, {"float64", Type::float64}};

std::size_t size_of(Type type) {
  switch (type) {
    case Type::int8:
    case Type::uint8: return 1;
    case Type::int16:
    case Type::uint16: return 2;
    case Type::float64: return 8;
    default: return 4;
  }
}

// Of integer types other than uint8; 0: of others.
double largest_of(Type type) {
  switch (type) {
    case Type::int8: return 127.0;
    case Type::int16: return 32767.0;
    case Type::uint16: return 65535.0;
    case Type::int32: return 2147483647.0;
    case Type::uint32: return 4294967295.0;
    default: return 0.0;
  }
}

struct Property {
  std::string name;
  Type type = Type::float32;
  bool list = false;
  Type count_type = Type::uint8;
};

struct PlyElement {
  std::string name;
  std::uint64_t count = 0;
  std::vector<Property> properties;
};

constexpr std::size_t kMostHeaderLines = 100000;  // each takes ten times its bytes, and attributes look at all

enum class Format { ascii, little, big };

// The attribute that a property is a channel of, as Mitsuba 3 groups them: "weight_0" and "weight_x" are of "weight",
// "r" and "red" of "color", "top_r" of "top_color". Empty: of none.
std::string attribute_of(const std::string& property) {
  static const char* const colors[] = {"r", "g", "b", "a", "red", "green", "blue", "alpha"};
  const std::size_t bar = property.rfind('_');
  const std::string suffix = bar == std::string::npos ? property : property.substr(bar + 1);
  const std::string prefix = bar == std::string::npos ? "" : property.substr(0, bar);
  if (std::find(std::begin(colors), std::end(colors), suffix) != std::end(colors))
    return prefix.empty() ? "color" : prefix + "_color";
  const bool index =
      !suffix.empty() && std::all_of(suffix.begin(), suffix.end(), [](char c) { return c >= '0' && c <= '9'; });
  const bool axis = suffix == "x" || suffix == "y" || suffix == "z" || suffix == "w";
  return index || axis ? prefix : "";
}

class PlyReader {
 public:
  PlyReader(const std::string& name, const std::string& bytes, const std::vector<std::string>& attributes)
      : name_(name),
        wanted_(attributes),
        bytes_(bytes),
        p_(bytes.data()),
        end_(p_ + bytes.size()) {}

  RawMesh read() {
    read_header();
    bool vertices = false, faces = false;
    for (const PlyElement& element : elements_) {
      check_count(element);
      if (element.name == "vertex" && !vertices) {
        read_vertices(element);
        vertices = true;
      } else if (element.name == "face" && !faces) {
        read_faces(element);
        faces = element.count > 0;
      } else if (element.name == "tristrips" && !faces) {
        read_strips(element);
        faces = true;
      } else if (!(vertices && faces)) {
        for (std::uint64_t i = 0; i < element.count; ++i) skip_row(element);
      }
    }
    if (!vertices) fail_at(bytes_.data(), "the PLY file has no element \"vertex\"");
    for (const Vec3i& triangle : mesh_.triangles) {
      for (int i = 0; i < 3; ++i) {
        if (triangle[i] < 0 || static_cast<std::size_t>(triangle[i]) >= mesh_.positions.size()) {
          fail_at(faces_begin_, "a face refers to vertex " + std::to_string(triangle[i]) + ", but there are " +
                                    std::to_string(mesh_.positions.size()));
        }
      }
    }
    return std::move(mesh_);
  }

 private:
  [[noreturn]] void fail_at(const char* where, const std::string& message) const {
    fail(name_, bytes_, static_cast<std::size_t>(where - bytes_.data()), message);
  }

  static bool is_space(char c) { return c == ' ' || c == '\t' || c == '\r' || c == '\n'; }

  // Words of the next header line.
  std::vector<std::string> header_line(const char*& begin) {
    if (p_ == end_) fail_at(p_, "the PLY header ends before end_header");
    begin = p_;
    std::vector<std::string> words;
    while (p_ < end_ && *p_ != '\n') {
      if (is_space(*p_)) {
        ++p_;
        continue;
      }
      const char* word = p_;
      while (p_ < end_ && !is_space(*p_)) ++p_;
      words.emplace_back(word, p_);
      if (words.size() > 64) fail_at(begin, "the line is no PLY header line");
    }
    if (p_ < end_) ++p_;
    return words;
  }

  Type read_type(const std::string& word, const char* where) const {
    for (const TypeName& known : kTypeNames) {
      if (word == known.name) return known.type;
    }
    fail_at(where, "unknown PLY type \"" + word +
                       "\"; supported: char, uchar, short, ushort, int, uint, float, double and int8 ... float64");
  }

  void read_header() {
    const char* begin = p_;
    std::vector<std::string> words = header_line(begin);
    if (words.size() != 1 || words[0] != "ply") fail_at(begin, "not a PLY file (the first line must be \"ply\")");
    bool format = false;
    std::size_t lines = 0;
    while (true) {
      words = header_line(begin);
      if (++lines > kMostHeaderLines)
        fail_at(begin, "the PLY header has more than " + std::to_string(kMostHeaderLines) + " lines");
      if (words.empty() || words[0] == "comment" || words[0] == "obj_info") continue;
      if (words[0] == "end_header") break;
      if (words[0] == "format" && words.size() == 3) {
        if (words[1] == "ascii") {
          format_ = Format::ascii;
        } else if (words[1] == "binary_little_endian") {
          format_ = Format::little;
        } else if (words[1] == "binary_big_endian") {
          format_ = Format::big;
        } else {
          fail_at(begin,
                  "unknown PLY format \"" + words[1] + "\"; supported: ascii, binary_little_endian, binary_big_endian");
        }
        format = true;
      } else if (words[0] == "element" && words.size() == 3) {
        PlyElement element;
        element.name = words[1];
        const auto result = std::from_chars(words[2].data(), words[2].data() + words[2].size(), element.count);
        if (result.ec != std::errc() || result.ptr != words[2].data() + words[2].size())
          fail_at(begin, "\"" + words[2] + "\" is not a number of elements");
        elements_.push_back(element);
      } else if (words[0] == "property" && words.size() == 3 && !elements_.empty()) {
        elements_.back().properties.push_back({words[2], read_type(words[1], begin), false, Type::uint8});
      } else if (words[0] == "property" && words.size() == 5 && words[1] == "list" && !elements_.empty()) {
        const Type count = read_type(words[2], begin);
        if (count == Type::float32 || count == Type::float64)
          fail_at(begin, "the length of a PLY list must have an integer type");
        elements_.back().properties.push_back({words[4], read_type(words[3], begin), true, count});
      } else {
        fail_at(begin, "unknown PLY header line starting with \"" + words[0] + "\"");
      }
    }
    if (!format) fail_at(bytes_.data(), "the PLY header has no format line");
  }

  // No allocation is larger than what the rest of the file can fill.
  void check_count(const PlyElement& element) const {
    std::uint64_t row = 0;
    for (const Property& property : element.properties) {
      row += format_ == Format::ascii ? 1 : size_of(property.list ? property.count_type : property.type);
    }
    const auto left = static_cast<std::uint64_t>(end_ - p_);
    if (element.count > kMostMeshElements ||
        (element.count > 0 && element.count > left / std::max<std::uint64_t>(row, 1))) {
      fail_at(p_, "the header announces " + std::to_string(element.count) + " of element \"" + element.name +
                      "\", but only " + std::to_string(left) + " bytes follow");
    }
    if (element.count > 0 && element.properties.empty())
      fail_at(p_, "element \"" + element.name + "\" has no properties");
  }

  template <typename T>
  T read_raw() {
    if (static_cast<std::size_t>(end_ - p_) < sizeof(T)) fail_at(p_, "the PLY file ends early");
    char buffer[sizeof(T)];
    std::memcpy(buffer, p_, sizeof(T));
    p_ += sizeof(T);
    constexpr bool big_machine = std::endian::native == std::endian::big;
    if ((format_ == Format::big) != big_machine) std::reverse(buffer, buffer + sizeof(T));
    return std::bit_cast<T>(std::to_array(buffer));
  }

  double read_value(Type type) {
    if (format_ == Format::ascii) {
      while (p_ < end_ && is_space(*p_)) ++p_;
      if (p_ == end_) fail_at(p_, "the PLY file ends early");
      double value = 0.0;
      const auto result = read_decimal(*p_ == '+' ? p_ + 1 : p_, end_, value);
      if (result.ec != std::errc() || (result.ptr < end_ && !is_space(*result.ptr))) fail_at(p_, "expected a number");
      p_ = result.ptr;
      return value;
    }
    switch (type) {
      case Type::int8: return read_raw<std::int8_t>();
      case Type::uint8: return read_raw<std::uint8_t>();
      case Type::int16: return read_raw<std::int16_t>();
      case Type::uint16: return read_raw<std::uint16_t>();
      case Type::int32: return read_raw<std::int32_t>();
      case Type::uint32: return read_raw<std::uint32_t>();
      case Type::float32: return read_raw<float>();
      case Type::float64: return read_raw<double>();
    }
    return 0.0;
  }

  std::int64_t read_integer(Type type) {
    const char* where = p_;
    const double value = read_value(type);
    if (!(std::fabs(value) < 1e15) || value != std::floor(value)) fail_at(where, "expected an integer");
    return static_cast<std::int64_t>(value);
  }

  std::int64_t read_list_length(Type type) {
    const char* where = p_;
    const std::int64_t length = read_integer(type);
    if (length < 0 || length > end_ - p_)
      fail_at(where, "a list of " + std::to_string(length) + " items does not fit in the file");
    return length;
  }

  void skip_property(const Property& property) {
    const std::int64_t n = property.list ? read_list_length(property.count_type) : 1;
    for (std::int64_t i = 0; i < n; ++i) read_value(property.type);
  }

  void skip_row(const PlyElement& element) {
    for (const Property& property : element.properties) skip_property(property);
  }

  void read_vertices(const PlyElement& element) {
    std::vector<int> targets;
    bool have[8] = {};
    for (const Property& property : element.properties) {
      int target = -1;
      for (const auto& [name, slot] : kTargets) {
        if (property.name == name && !property.list && !have[slot]) target = slot;
      }
      if (target >= 0) have[target] = true;
      targets.push_back(target);
    }
    if (!have[0] || !have[1] || !have[2]) fail_at(bytes_.data(), "element \"vertex\" lacks x, y or z");
    const bool normals = have[3] && have[4] && have[5], uvs = have[6] && have[7];
    ask_memory(element.count * sizeof(float) * (3 + (normals ? 3 : 0) + (uvs ? 2 : 0)), name_);
    mesh_.positions.reserve(element.count);
    if (normals) mesh_.normals.reserve(element.count);
    if (uvs) mesh_.uvs.reserve(element.count);
    const std::vector<Channel> channels = attribute_channels(element, "vertex_");
    for (std::uint64_t i = 0; i < element.count; ++i) {
      const char* where = p_;
      float row[8] = {};
      bool without_normal = false;
      for (std::size_t j = 0; j < targets.size(); ++j) {
        if (targets[j] < 0 && channels[j].channel >= 0) {
          read_channel(channels[j], element.properties[j]);
        } else if (targets[j] < 0) {
          skip_property(element.properties[j]);
        } else {
          const auto value = static_cast<float>(read_value(element.properties[j].type));
          if (std::isfinite(value)) row[targets[j]] = value;
          else if (targets[j] < 3)
            fail_at(where,
                    "vertex " + std::to_string(i) + " has a \"" + element.properties[j].name + "\" that is not finite");
          else without_normal |= targets[j] < 6;  // some exporters write nan where an edge has no length
        }
      }
      mesh_.positions.push_back({row[0], row[1], row[2]});
      if (normals) mesh_.normals.push_back(without_normal ? Vec3f(0.0f) : Vec3f(row[3], row[4], row[5]));
      if (uvs) mesh_.uvs.push_back({row[6], row[7]});
    }
  }

  // Of the wanted attributes of vertices or faces: where each property goes, [attribute][channel], or nowhere.
  struct Channel {
    std::size_t attribute;  // in mesh_.attributes
    int channel;            // -1: nowhere
  };
  std::vector<Channel> attribute_channels(const PlyElement& element, const std::string& kind) {
    std::vector<Channel> channels(element.properties.size(), Channel{0, -1});
    for (const std::string& name : wanted_) {
      const auto same = [&](const MeshAttribute& other) { return other.name == name; };
      if (name.compare(0, kind.size(), kind) != 0 ||
          std::any_of(mesh_.attributes.begin(), mesh_.attributes.end(), same))  // wanted twice
        continue;
      MeshAttribute attribute{name, 0, {}};
      for (std::size_t j = 0; j < channels.size(); ++j) {
        const Property& property = element.properties[j];
        if (!property.list && attribute.channels < 3 && attribute_of(property.name) == name.substr(kind.size())) {
          channels[j] = {mesh_.attributes.size(), attribute.channels++};
          attribute.bytes = property.type == Type::uint8;
        }
      }
      if (attribute.channels == 0) continue;
      if (attribute.channels == 2)
        fail_at(bytes_.data(), "the attribute \"" + name + "\" has two channels; one or three can be shown");
      ask_memory(element.count * sizeof(float) * static_cast<std::size_t>(attribute.channels), name_);
      attribute.values.reserve(element.count * static_cast<std::size_t>(attribute.channels));
      mesh_.attributes.push_back(std::move(attribute));
    }
    return channels;
  }

  // Reads one property of an attribute; its channels stand in the file in their order. Integers are shares of their
  // type's largest and encoded as sRGB, but for uchar, which stays as it is: Mitsuba 3.9.1.
  void read_channel(const Channel& channel, const Property& property) {
    const char* where = p_;
    const double read = read_value(property.type), largest = largest_of(property.type);
    const auto value = static_cast<float>(largest > 0.0 ? decode_srgb(read / largest) : read);
    if (!std::isfinite(value)) fail_at(where, "the attribute property \"" + property.name + "\" is not finite");
    mesh_.attributes[channel.attribute].values.push_back(value);
  }

  static bool is_vertex_list(const Property& property) {
    return property.list && (property.name == "vertex_indices" || property.name == "vertex_index");
  }

  void read_faces(const PlyElement& element) {
    faces_begin_ = p_;
    const std::vector<Channel> channels = attribute_channels(element, "face_");
    std::size_t indices = element.properties.size();
    for (std::size_t j = 0; j < element.properties.size(); ++j) {
      const Property& property = element.properties[j];
      if (is_vertex_list(property)) indices = j;
    }
    if (indices == element.properties.size()) fail_at(bytes_.data(), "element \"face\" lacks the list vertex_indices");
    ask_memory(element.count * sizeof(Vec3i), name_);
    mesh_.triangles.reserve(element.count);
    for (std::uint64_t i = 0; i < element.count; ++i) {
      const std::size_t first_triangle = mesh_.triangles.size();
      for (std::size_t j = 0; j < element.properties.size(); ++j) {
        if (channels[j].channel >= 0) {
          read_channel(channels[j], element.properties[j]);
          continue;
        }
        if (j != indices) {
          skip_property(element.properties[j]);
          continue;
        }
        const Property& property = element.properties[j];
        const char* where = p_;
        const std::int64_t n = read_list_length(property.count_type);
        int first = -1, last = -1;
        for (std::int64_t k = 0; k < n; ++k) {
          const std::int64_t index = read_integer(property.type);
          if (index < 0 || index > std::numeric_limits<int>::max())
            fail_at(where, "face " + std::to_string(i) + " refers to vertex " + std::to_string(index));
          const int vertex = static_cast<int>(index);
          if (k == 0) first = vertex;
          ask_to_grow(mesh_.triangles, name_);
          if (k >= 2) mesh_.triangles.push_back({first, last, vertex});
          last = vertex;
        }
        if (mesh_.triangles.size() > kMostMeshElements) fail_at(where, "the PLY file has too many faces");
      }
      repeat_face(mesh_.triangles.size() - first_triangle);
    }
  }

  // Strips of triangles, as trimesh2 writes them: each vertex makes a triangle with the two before it, every second one
  // turned; a negative index ends a strip.
  void read_strips(const PlyElement& element) {
    faces_begin_ = p_;
    for (std::uint64_t i = 0; i < element.count; ++i) {
      for (const Property& property : element.properties) {
        if (!is_vertex_list(property)) {
          skip_property(property);
          continue;
        }
        const char* where = p_;
        const std::int64_t n = read_list_length(property.count_type);
        int length = 0;
        Vec3i t{0, 0, 0};  // the last three vertices of the strip
        for (std::int64_t k = 0; k < n; ++k) {
          const std::int64_t index = read_integer(property.type);
          if (index > std::numeric_limits<int>::max())
            fail_at(where, "a strip of triangles refers to vertex " + std::to_string(index));
          if (index < 0) {
            length = 0;
            continue;
          }
          t = {t.y, t.z, static_cast<int>(index)};
          if (++length < 3) continue;
          ask_to_grow(mesh_.triangles, name_);
          mesh_.triangles.push_back(length % 2 == 1 ? t : Vec3i(t.y, t.x, t.z));
          if (mesh_.triangles.size() > kMostMeshElements) fail_at(where, "the PLY file has too many faces");
        }
      }
    }
  }

  // The triangles of a polygon all have its attributes; faces of one or two corners are left out, as in OBJ files.
  void repeat_face(std::size_t triangles) {
    for (MeshAttribute& attribute : mesh_.attributes) {
      if (!attribute.name.starts_with("face_")) continue;
      const auto channels = static_cast<std::size_t>(attribute.channels);
      if (triangles == 0) attribute.values.resize(attribute.values.size() - channels);
      for (std::size_t k = 1; k < triangles; ++k) {
        for (std::size_t c = 0; c < channels; ++c) {
          ask_to_grow(attribute.values, name_);
          attribute.values.push_back(attribute.values[attribute.values.size() - channels]);
        }
      }
    }
  }

  const std::string& name_;
  const std::vector<std::string>& wanted_;  // attributes
  const std::string& bytes_;
  const char* p_;
  const char* end_;
  const char* faces_begin_ = nullptr;
  Format format_ = Format::ascii;
  std::vector<PlyElement> elements_;
  RawMesh mesh_;
};

}  // namespace

RawMesh parse_ply(const std::string& name, const std::string& bytes, const std::vector<std::string>& attributes) {
  return PlyReader(name, bytes, attributes).read();
}

RawMesh read_ply(const std::string& file, const std::vector<std::string>& attributes) {
  return parse_ply(file, read_file(file), attributes);
}

std::string ply_bytes(const RawMesh& mesh) {
  std::string out = "ply\nformat binary_little_endian 1.0\nelement vertex " + std::to_string(mesh.positions.size()) +
                    "\nproperty float x\nproperty float y\nproperty float z\n";
  if (!mesh.normals.empty()) out += "property float nx\nproperty float ny\nproperty float nz\n";
  if (!mesh.uvs.empty()) out += "property float u\nproperty float v\n";
  const auto color = std::find_if(mesh.attributes.begin(), mesh.attributes.end(),
                                  [](const MeshAttribute& a) { return a.name == "vertex_color" && a.channels == 3; });
  if (color != mesh.attributes.end()) out += "property float r\nproperty float g\nproperty float b\n";
  out += "element face " + std::to_string(mesh.triangles.size()) +
         "\nproperty list uchar int vertex_indices\nend_header\n";
  const auto put = [&](const void* values, std::size_t bytes) { out.append(static_cast<const char*>(values), bytes); };
  for (std::size_t i = 0; i < mesh.positions.size(); ++i) {
    put(&mesh.positions[i], sizeof(Vec3f));
    if (!mesh.normals.empty()) put(&mesh.normals[i], sizeof(Vec3f));
    if (!mesh.uvs.empty()) put(&mesh.uvs[i], sizeof(Vec2f));
    if (color != mesh.attributes.end()) put(color->values.data() + 3 * i, 3 * sizeof(float));
  }
  for (const Vec3i& triangle : mesh.triangles) {
    out += '\3';
    put(&triangle, sizeof triangle);
  }
  return out;
}

bool is_ply_coordinate(std::string_view property) {
  return std::any_of(std::begin(kTargets), std::end(kTargets),
                     [&](const auto& target) { return target.first == property && target.second == kFirstCoordinate; });
}

}  // namespace octrad
