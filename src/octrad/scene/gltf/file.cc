#include "octrad/scene/gltf/file.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <limits>
#include <set>

#include "octrad/base/input_file.h"
#include "octrad/base/join.h"
#include "octrad/base/json_file.h"
#include "octrad/base/memory_limit.h"
#include "octrad/base/number_text.h"
#include "octrad/scene/gltf/meshopt.h"
#include "octrad/scene/limits.h"

namespace octrad {
namespace {

static_assert(std::endian::native == std::endian::little);

constexpr char kMeshopt[] = "EXT_meshopt_compression";
constexpr std::size_t kMaxUri = 1 << 14;  // of a file: no name is that long, and many may refer to it
constexpr std::uint64_t kNumbersRead = 1 << 28, kNumbersReadPerByte = 64;  // from accessors, in all
// Objects of lists, in all. Those of a mesh are read again for each node that poses it.
constexpr std::uint64_t kItemsRead = 1'000'000, kBytesPerItem = 8;
constexpr std::uint64_t kMaxZeros = 1 << 24;  // elements of an accessor without data, which the file need not hold

enum Component { kByte = 5120, kUnsignedByte, kShort, kUnsignedShort, kUnsignedInt = 5125, kFloat };

std::size_t component_size(int type) {
  return type == kByte || type == kUnsignedByte ? 1 : type == kShort || type == kUnsignedShort ? 2 : 4;
}

template <typename T>
T load(const char* from) {
  T value;
  std::memcpy(&value, from, sizeof value);
  return value;
}

float component(const char* from, int type, bool normalized) {
  switch (type) {
    case kByte: {
      const auto v = static_cast<float>(load<std::int8_t>(from));
      return normalized ? std::max(v / 127.0f, -1.0f) : v;
    }
    case kUnsignedByte: return static_cast<float>(load<std::uint8_t>(from)) / (normalized ? 255.0f : 1.0f);
    case kShort: {
      const auto v = static_cast<float>(load<std::int16_t>(from));
      return normalized ? std::max(v / 32767.0f, -1.0f) : v;
    }
    case kUnsignedShort: return static_cast<float>(load<std::uint16_t>(from)) / (normalized ? 65535.0f : 1.0f);
    case kUnsignedInt: return static_cast<float>(load<std::uint32_t>(from));
    default: return load<float>(from);
  }
}

std::uint32_t whole(const char* from, int type) {
  return type == kUnsignedByte    ? load<std::uint8_t>(from)
         : type == kUnsignedShort ? load<std::uint16_t>(from)
                                  : load<std::uint32_t>(from);
}

int hex_digit(char c) {
  if (c >= '0' && c <= '9') return c - '0';
  if (c >= 'a' && c <= 'f') return c - 'a' + 10;
  return c >= 'A' && c <= 'F' ? c - 'A' + 10 : -1;
}

// A limit that was rounded when it was written is one.
double within_rounding(double value, double upper) {
  return value > upper && value <= upper + 1e-4 * std::fabs(upper) ? upper : value;
}

}  // namespace

Location GltfObject::location() const {
  std::string place = file_->name();
  if (!path_.empty()) place += ": " + path_;
  if (const nlohmann::json* name = member("name"); name && name->is_string() && !path_.empty())
    place += " \"" + name->get_ref<const std::string&>().substr(0, 100) + "\"";
  return {std::make_shared<const SourceFile>(std::move(place), ""), 0};
}

const nlohmann::json* GltfObject::member(const std::string& key) const {
  if (!object_) return nullptr;
  const auto found = object_->find(key);
  // Some writers say null for what is infinite or not there.
  return found == object_->end() || found->is_null() ? nullptr : &*found;
}

void GltfObject::wrong(const std::string& key, const std::string& expected) const {
  fail("\"" + key + "\" must be " + expected);
}

GltfObject GltfObject::object(const std::string& key) const {
  const nlohmann::json* found = member(key);
  if (found && !found->is_object()) wrong(key, "an object");
  return {file_, found, path_.empty() ? key : path_ + "." + key};
}

std::vector<GltfObject> GltfObject::objects(const std::string& key) const {
  std::vector<GltfObject> result;
  const nlohmann::json* found = member(key);
  if (!found) return result;
  if (!found->is_array()) wrong(key, "a list of objects");
  file_->count_items(found->size(), *this);
  for (std::size_t i = 0; i < found->size(); ++i) {
    if (!(*found)[i].is_object()) wrong(key, "a list of objects");
    result.push_back({file_, &(*found)[i], (path_.empty() ? key : path_ + "." + key) + "[" + std::to_string(i) + "]"});
  }
  return result;
}

GltfObject GltfObject::object_at(const std::string& key, std::uint64_t at) const {
  const nlohmann::json* found = member(key);
  if (found && !found->is_array()) wrong(key, "a list of objects");
  const nlohmann::json* object = found && at < found->size() ? &(*found)[at] : nullptr;
  if (object && !object->is_object()) wrong(key, "a list of objects");
  return {file_, object, (path_.empty() ? key : path_ + "." + key) + "[" + std::to_string(at) + "]"};
}

std::vector<std::string> GltfObject::keys() const {
  std::vector<std::string> result;
  if (object_) {
    for (const auto& [key, value] : object_->items()) {
      if (!value.is_null()) result.push_back(key);  // null is what is not there
    }
  }
  return result;
}

double GltfObject::number(const std::string& key, double fallback, double lower, double upper) const {
  const nlohmann::json* found = member(key);
  if (!found) return fallback;
  const double value =
      found->is_number() ? within_rounding(found->get<double>(), upper) : std::numeric_limits<double>::quiet_NaN();
  if (!(value >= lower && value <= upper)) {
    wrong(key, lower > -1e30 || upper < 1e30
                   ? "a number from " + number_text(lower) + (upper < 1e30 ? " to " + number_text(upper) : " on")
                   : "a number");
  }
  return value;
}

int GltfObject::integer(const std::string& key, int fallback, int lower, int upper) const {
  const double value = number(key, fallback, lower, upper);
  if (value != std::floor(value)) wrong(key, "a whole number");
  return static_cast<int>(value);
}

std::uint64_t GltfObject::size(const std::string& key, std::uint64_t fallback) const {
  const nlohmann::json* found = member(key);
  if (!found) return fallback;
  // Some writers give whole numbers with a point.
  const double value = found->is_number() ? found->get<double>() : -1.0;
  if (!(value >= 0.0 && value < 9e15) || value != std::floor(value)) wrong(key, "a whole number from 0 on");
  return static_cast<std::uint64_t>(value);
}

std::vector<double> GltfObject::numbers(const std::string& key, std::vector<double> fallback, double lower,
                                        double upper) const {
  const nlohmann::json* found = member(key);
  if (!found) return fallback;
  const std::string expected = "a list of " + std::to_string(fallback.size()) + " numbers" +
                               (upper < 1e30 ? " from " + number_text(lower) + " to " + number_text(upper) : "");
  if (!found->is_array() || found->size() != fallback.size()) wrong(key, expected);
  for (std::size_t i = 0; i < fallback.size(); ++i) {
    fallback[i] = (*found)[i].is_number() ? within_rounding((*found)[i].get<double>(), upper)
                                          : std::numeric_limits<double>::quiet_NaN();
    if (!(fallback[i] >= lower && fallback[i] <= upper)) wrong(key, expected);
  }
  return fallback;
}

template <typename T>
std::vector<T> GltfObject::list(const std::string& key, const std::string& expected,
                                bool (nlohmann::json::*is)() const noexcept) const {
  std::vector<T> result;
  const nlohmann::json* found = member(key);
  if (!found) return result;
  if (!found->is_array()) wrong(key, expected);
  for (const nlohmann::json& value : *found) {
    if (!(value.*is)()) wrong(key, expected);
    result.push_back(value.get<T>());
  }
  return result;
}

std::vector<std::uint64_t> GltfObject::sizes(const std::string& key) const {
  return list<std::uint64_t>(key, "a list of indices", &nlohmann::json::is_number_unsigned);
}

std::vector<std::string> GltfObject::texts(const std::string& key) const {
  return list<std::string>(key, "a list of names", &nlohmann::json::is_string);
}

std::string GltfObject::text(const std::string& key, const std::string& fallback) const {
  return has(key) ? long_text(key) : fallback;
}

const std::string& GltfObject::long_text(const std::string& key) const {
  static const std::string none;
  const nlohmann::json* found = member(key);
  if (found && !found->is_string()) wrong(key, "a text");
  return found ? found->get_ref<const std::string&>() : none;
}

bool GltfObject::flag(const std::string& key) const {
  const nlohmann::json* found = member(key);
  if (found && !found->is_boolean()) wrong(key, "true or false");
  return found && found->get<bool>();
}

int GltfObject::index(const std::string& key, const std::string& list) const {
  if (!has(key)) return -1;
  const std::uint64_t value = size(key, 0);
  if (value >= file_->count(list))
    fail("\"" + key + "\" is " + std::to_string(value) + ", but the file has " + std::to_string(file_->count(list)) +
         " " + list);
  return static_cast<int>(value);
}

GltfFile::GltfFile(const std::string& file, std::string bytes, const Description& description)
    : name_(file),
      description_(description),
      most_items_(kItemsRead + bytes.size() / kBytesPerItem) {
  if (bytes.starts_with("glTF")) read_binary(bytes);
  else json_ = parse_json(bytes, name_);
  bytes = {};
  if (!json_.is_object()) root().fail("a glTF file is a JSON object");
  const GltfObject asset = root().object("asset");
  const std::string version = asset.text("version", "");
  if (!version.starts_with("2."))
    root().fail(version.empty() ? "not a glTF file: it has no asset.version"
                                : "glTF " + version + " is not supported; supported: 2.x");
  for (const char* list : {"accessors", "bufferViews", "buffers", "cameras", "images", "materials", "meshes", "nodes",
                           "samplers", "scenes", "skins", "textures"}) {
    const auto found = json_.find(list);
    if (found != json_.end() && !found->is_array()) root().fail(std::string("\"") + list + "\" must be a list");
  }
  load_buffers();
  decode_views();
}

// The container: 12 bytes of header, then chunks of a length, a type and content; first JSON, then at most one BIN.
void GltfFile::read_binary(const std::string& bytes) {
  const auto number = [&](std::size_t at) { return load<std::uint32_t>(bytes.data() + at); };
  if (bytes.size() < 20) root().fail("the .glb file ends early");
  if (number(4) != 2) root().fail("glTF " + std::to_string(number(4)) + " is not supported; supported: 2.x");
  const std::uint64_t length = number(8);
  if (length > bytes.size() || length < 20)
    root().fail("the .glb file announces " + std::to_string(length) + " bytes, but has " +
                std::to_string(bytes.size()));
  constexpr std::uint32_t kJson = 0x4e4f534a, kBin = 0x004e4942;
  bool json = false;
  for (std::uint64_t at = 12; at + 8 <= length;) {
    const std::uint64_t size = number(at);
    const std::uint32_t type = number(at + 4);
    at += 8;
    if (size > length - at) root().fail("a chunk of the .glb file is longer than the file");
    if (!json && type != kJson) root().fail("the first chunk of a .glb file must be JSON");
    if (!json) json_ = parse_json(bytes.substr(at, size), name_);
    else if (type == kBin && binary_.empty()) binary_ = bytes.substr(at, size);
    json = true;
    at += size;
  }
}

std::size_t GltfFile::count(const std::string& list) const {
  const auto found = json_.find(list);
  return found == json_.end() ? 0 : found->size();
}

GltfObject GltfFile::item(const std::string& list, int index) const {
  const nlohmann::json& item = json_.at(list).at(static_cast<std::size_t>(index));
  GltfObject result{this, &item, list + "[" + std::to_string(index) + "]"};
  if (!item.is_object()) octrad::fail(GltfObject(this, nullptr, result.path()).location(), "must be an object");
  return result;
}

std::string GltfFile::resolve(const std::string& uri, const GltfObject& user) const {
  const std::string shown = "\"" + uri.substr(0, 200) + "\"";
  if (uri.size() > kMaxUri) user.fail("the uri " + shown + "... is longer than " + std::to_string(kMaxUri) + " bytes");
  std::string file;
  for (std::size_t i = 0; i < uri.size(); ++i) {
    const int high = uri[i] == '%' && i + 2 < uri.size() ? hex_digit(uri[i + 1]) : -1;
    const int low = high >= 0 ? hex_digit(uri[i + 2]) : -1;
    if (low >= 0) {
      file += static_cast<char>(16 * high + low);
      i += 2;
    } else {
      file += uri[i];
    }
  }
  // Names of another system are looked for with slashes, too.
  std::string slashes = file;
  std::replace(slashes.begin(), slashes.end(), '\\', '/');
  const std::filesystem::path path(slashes);
  const std::size_t colon = file.find(':');
  if (file.find('\0') != std::string::npos || path.is_absolute() ||
      (colon != std::string::npos && file.find('/') > colon))
    user.fail("the uri " + shown + " must be a relative path or data:…;base64,…");
  return description_.resolve(file, user.location());
}

std::string GltfFile::decode(const std::string& uri, const GltfObject& user) {
  const std::size_t comma = uri.find(',');
  if (comma == std::string::npos || !uri.substr(0, comma).ends_with(";base64"))
    user.fail("a data uri must be in base64");
  ask_memory(uri.size(), user.location().text());
  std::string out;
  out.reserve((uri.size() - comma) / 4 * 3 + 3);
  unsigned bits = 0, held = 0;
  std::size_t end = uri.size();
  while (end > comma + 1 && uri[end - 1] == '=') --end;
  for (std::size_t i = comma + 1; i < end; ++i) {
    const char c = uri[i];
    unsigned digit = 64;
    if (c >= 'A' && c <= 'Z') digit = static_cast<unsigned>(c - 'A');
    if (c >= 'a' && c <= 'z') digit = static_cast<unsigned>(c - 'a') + 26;
    if (c >= '0' && c <= '9') digit = static_cast<unsigned>(c - '0') + 52;
    if (c == '+' || c == '-') digit = 62;
    if (c == '/' || c == '_') digit = 63;
    if (digit == 64) user.fail("the data uri is not in base64: character " + std::to_string(i + 1));
    bits = (bits << 6 | digit) & 0xffff;
    held += 6;
    if (held < 8) continue;
    held -= 8;
    out += static_cast<char>(bits >> held & 0xff);
  }
  return out;
}

void GltfFile::load_buffers() {
  // What no view shows is not read.
  std::set<int> used;
  for (std::size_t i = 0; i < count("bufferViews"); ++i) {
    const GltfObject view = item("bufferViews", static_cast<int>(i));
    used.insert(view.index("buffer", "buffers"));
    if (const GltfObject compressed = view.extension(kMeshopt); compressed.exists())
      used.insert(compressed.index("buffer", "buffers"));
  }
  for (std::size_t i = 0; i < count("buffers"); ++i) {
    const GltfObject buffer = item("buffers", static_cast<int>(i));
    const std::uint64_t length = buffer.size("byteLength", 0);
    const std::string& uri = buffer.long_text("uri");
    if (length == 0) buffer.fail("needs a byteLength above 0");
    std::string content;
    // A fallback is for readers that cannot decode what is compressed.
    if (used.count(static_cast<int>(i)) == 0 || buffer.extension(kMeshopt).flag("fallback") ||
        (uri.empty() && (i > 0 || binary_.empty()))) {
      buffers_.emplace_back();
      continue;
    }
    if (uri.empty()) content = std::move(binary_);
    else content = is_data(uri) ? decode(uri, buffer) : read_file(resolve(uri, buffer));
    if (content.size() < length)
      buffer.fail("byteLength is " + std::to_string(length) + ", but there are " + std::to_string(content.size()) +
                  " bytes");
    content.resize(length);
    buffer_bytes_ += length;
    buffers_.push_back(std::move(content));
  }
}

// The extension says once more what the view says. Many views of one range would take memory in the square of the
// file's size.
void GltfFile::decode_views() {
  decoded_.resize(count("bufferViews"));
  std::uint64_t sum = 0;
  for (std::size_t i = 0; i < decoded_.size(); ++i) {
    const GltfObject view = item("bufferViews", static_cast<int>(i)), compressed = view.extension(kMeshopt);
    if (!compressed.exists()) continue;
    const std::uint64_t stride = compressed.size("byteStride", 0);
    if (view.size("byteStride", stride) != stride) view.fail("its byteStride is not that of the compressed data");
    decoded_[i] = decode_meshopt(compressed, range_of_buffer(compressed));
    if (view.size("byteLength", 0) != decoded_[i].size())
      view.fail("byteLength is not that of the compressed data: " + std::to_string(decoded_[i].size()));
    sum += decoded_[i].size();
    if (sum > kMeshoptRatio * buffer_bytes_) view.fail("compressed data are used too often");
  }
}

std::string_view GltfFile::range_of_buffer(const GltfObject& range) const {
  const int buffer = range.index("buffer", "buffers");
  if (buffer < 0) range.fail("needs a buffer");
  const std::string& bytes = buffers_[static_cast<std::size_t>(buffer)];
  if (bytes.empty()) item("buffers", buffer).fail("has no uri, and the file no binary chunk for it");
  const std::uint64_t offset = range.size("byteOffset", 0), length = range.size("byteLength", 0);
  if (offset > bytes.size() || length > bytes.size() - offset) {
    range.fail("byteOffset " + std::to_string(offset) + " and byteLength " + std::to_string(length) +
               " lead beyond the buffer of " + std::to_string(bytes.size()) + " bytes");
  }
  return std::string_view(bytes).substr(offset, length);
}

std::string_view GltfFile::view(int index) const {
  if (index < 0) return {};
  const std::string& decoded = decoded_[static_cast<std::size_t>(index)];
  return decoded.empty() ? range_of_buffer(item("bufferViews", index)) : std::string_view(decoded);
}

GltfFile::Elements GltfFile::elements(int buffer_view, std::uint64_t offset, std::uint64_t count, std::size_t size,
                                      bool packed, const GltfObject& user) const {
  const std::string_view bytes = view(buffer_view);
  const std::uint64_t stride = packed ? size : item("bufferViews", buffer_view).size("byteStride", size);
  if (stride < size || stride > 65536) user.fail("the byteStride of its buffer view does not fit its elements");
  if (offset > bytes.size() || size > bytes.size() - offset || (count - 1) > (bytes.size() - offset - size) / stride) {
    user.fail("its " + std::to_string(count) + " elements lead beyond the buffer view of " +
              std::to_string(bytes.size()) + " bytes");
  }
  return {bytes.data() + offset, count, stride};
}

// each(place of the value in a buffer, element that it replaces)
template <typename Each>
void GltfFile::for_each_sparse(const GltfObject& accessor, std::uint64_t count, std::size_t size, Each each) const {
  const GltfObject sparse = accessor.object("sparse");
  if (!sparse.exists()) return;
  const std::uint64_t replaced = sparse.size("count", 0);
  if (replaced == 0 || replaced > count) sparse.fail("needs a count from 1 to that of the accessor");
  const GltfObject at = sparse.object("indices"), with = sparse.object("values");
  const int index_kind = at.integer("componentType", 0, kByte, kFloat);
  if (index_kind != kUnsignedByte && index_kind != kUnsignedShort && index_kind != kUnsignedInt)
    at.fail("needs a componentType of 5121, 5123 or 5125");
  const int index_view = at.index("bufferView", "bufferViews"), value_view = with.index("bufferView", "bufferViews");
  if (index_view < 0 || value_view < 0) sparse.fail("needs buffer views of indices and values");
  const Elements where = elements(index_view, at.size("byteOffset", 0), replaced, component_size(index_kind), true, at);
  const Elements what = elements(value_view, with.size("byteOffset", 0), replaced, size, true, with);
  for (std::size_t i = 0; i < replaced; ++i) {
    const std::uint32_t to = whole(where.first + i * where.stride, index_kind);
    if (to >= count) at.fail("index " + std::to_string(to) + " is beyond the accessor");
    each(what.first + i * what.stride, to);
  }
}

GltfValues GltfFile::values(int accessor, std::vector<int> components) const {
  const GltfObject a = item("accessors", accessor);
  const std::string type = a.text("type", "");
  static const std::pair<const char*, int> kTypes[] = {
      {"SCALAR", 1}, {"VEC2", 2}, {"VEC3", 3}, {"VEC4", 4}, {"MAT4", 16}};
  GltfValues result;
  for (const auto& [name, number] : kTypes) {
    if (type == name) result.components = number;
  }
  if (std::find(components.begin(), components.end(), result.components) == components.end()) {
    std::vector<std::string> names;
    for (const auto& [name, number] : kTypes) {
      if (std::find(components.begin(), components.end(), number) != components.end()) names.push_back(name);
    }
    a.fail("the type must be " + join(names, " or ") + " here, not \"" + type + "\"");
  }
  const int kind = a.integer("componentType", 0, kByte, kFloat);
  if (kind == 5124 || kind == 0) a.fail("needs a componentType of 5120 to 5123, 5125 or 5126");
  const bool normalized = a.flag("normalized");
  const std::uint64_t count = a.size("count", 0);
  const int buffer_view = a.index("bufferView", "bufferViews");
  if (count == 0) a.fail("needs a count above 0");
  if (count > (buffer_view < 0 ? kMaxZeros : kMostMeshElements)) a.fail("has too many elements");
  const auto n = static_cast<std::size_t>(result.components);
  const std::size_t bytes = component_size(kind), size = bytes * n;
  Elements source;
  if (buffer_view >= 0) source = elements(buffer_view, a.size("byteOffset", 0), count, size, false, a);
  count_read(count * n, a);
  ask_memory(count * n * sizeof(float), name_);
  result.count = count;
  result.values.assign(count * n, 0.0f);
  const auto read = [&](const char* from, std::size_t to) {
    for (std::size_t c = 0; c < n; ++c) {
      const float value = component(from + c * bytes, kind, normalized);
      if (!std::isfinite(value)) a.fail("element " + std::to_string(to) + " is not finite");
      result.values[to * n + c] = value;
    }
  };
  for (std::size_t i = 0; i < source.count; ++i) read(source.first + i * source.stride, i);
  for_each_sparse(a, count, size, read);
  return result;
}

// A few words say once more that an accessor is used, and reading it takes time: all of it must go with the file's
// size.
void GltfFile::count_read(std::uint64_t numbers, const GltfObject& accessor) const {
  const std::uint64_t most = kNumbersRead + kNumbersReadPerByte * buffer_bytes_;
  numbers_read_ += numbers;
  if (numbers_read_ > most)
    accessor.fail("the accessors are used too often: more than " + std::to_string(most) +
                  " numbers would be read from buffers of " + std::to_string(buffer_bytes_) + " bytes");
}

void GltfFile::count_items(std::uint64_t items, const GltfObject& owner) const {
  items_read_ += items;
  if (items_read_ > most_items_)
    owner.fail("the lists of meshes are used too often: more than " + std::to_string(most_items_) +
               " primitives and targets would be read");
}

std::vector<std::uint32_t> GltfFile::indices(int accessor) const {
  const GltfObject a = item("accessors", accessor);
  const int kind = a.integer("componentType", 0, kByte, kFloat);
  if (a.text("type", "") != "SCALAR" || (kind != kUnsignedByte && kind != kUnsignedShort && kind != kUnsignedInt))
    a.fail("indices must be of type SCALAR and componentType 5121, 5123 or 5125");
  const int buffer_view = a.index("bufferView", "bufferViews");
  const std::uint64_t count = a.size("count", 0);
  if (buffer_view < 0 && !a.object("sparse").exists()) a.fail("indices need a bufferView");
  if (count == 0) a.fail("needs a count above 0");
  if (count > (buffer_view < 0 ? kMaxZeros : kMostMeshElements * 3)) a.fail("has too many elements");
  const std::size_t size = component_size(kind);
  Elements source;
  if (buffer_view >= 0) source = elements(buffer_view, a.size("byteOffset", 0), count, size, false, a);
  count_read(count, a);
  ask_memory(count * sizeof(std::uint32_t), name_);
  std::vector<std::uint32_t> result(count);
  for (std::size_t i = 0; i < source.count; ++i) result[i] = whole(source.first + i * source.stride, kind);
  for_each_sparse(a, count, size, [&](const char* from, std::size_t to) { result[to] = whole(from, kind); });
  return result;
}

}  // namespace octrad
