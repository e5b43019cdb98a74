#include "octrad/model/safetensors.h"

#include <fmt/format.h>
#include <zlib.h>

#include <algorithm>
#include <bit>
#include <nlohmann/json.hpp>
#include <optional>

#include "octrad/base/atomic_file.h"
#include "octrad/base/error.h"
#include "octrad/base/input_file.h"
#include "octrad/base/json_file.h"
#include "octrad/base/memory_limit.h"
#include "octrad/base/threads.h"

namespace octrad {
namespace {

static_assert(std::endian::native == std::endian::little, "tensors are stored little-endian");

constexpr std::size_t kMaxHeader = 100'000'000;  // the reference implementation's limit
constexpr std::size_t kMaxRank = 16;
constexpr std::size_t kChecksumBlock = std::size_t{1} << 20;  // bytes whose checksum one thread computes at once

// Of the metadata: a JSON object of checksums, as eight hexadecimal digits, by the name of the tensor; of all other
// metadata by kMetadata.
constexpr const char* kChecksums = "octrad.checksums";
constexpr const char* kMetadata = "__metadata__";

struct TypeName {
  DType type;
  const char* name;
};
constexpr TypeName kTypes[] = {{DType::f32, "F32"}, {DType::f16, "F16"}, {DType::i32, "I32"},
                               {DType::i64, "I64"}, {DType::u8, "U8"},   {DType::u16, "U16"},
                               {DType::u32, "U32"}, {DType::u64, "U64"}, {DType::f64, "F64"}};

std::optional<DType> type_of(const std::string& name) {
  for (const TypeName& t : kTypes) {
    if (name == t.name) return t.type;
  }
  return std::nullopt;
}

std::string format_shape(const std::vector<std::int64_t>& shape) {
  std::string out = "[";
  for (std::size_t i = 0; i < shape.size(); ++i)
    out += (i > 0 ? ", " : "") + (shape[i] < 0 ? std::string("any") : std::to_string(shape[i]));
  return out + "]";
}

std::size_t product(const std::vector<std::int64_t>& shape) {
  std::size_t n = 1;
  for (const std::int64_t d : shape) n *= static_cast<std::size_t>(d);
  return n;
}

std::string json_bytes(const nlohmann::ordered_json& value) {
  return value.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace);
}

std::uint32_t crc(const void* data, std::size_t bytes, uLong before = 0) {
  return static_cast<std::uint32_t>(crc32_z(before, static_cast<const Bytef*>(data), bytes));
}

// The CRC-32 of `bytes` bytes from those of their blocks, block(begin, end). Parallel.
std::uint32_t crc_of_blocks(std::size_t bytes, std::size_t block_bytes,
                            const std::function<std::uint32_t(std::size_t, std::size_t)>& block) {
  std::vector<std::uint32_t> parts((bytes + block_bytes - 1) / block_bytes);
  parallel_blocks(bytes, block_bytes,
                  [&](std::size_t begin, std::size_t end) { parts[begin / block_bytes] = block(begin, end); });
  uLong all = 0;
  for (std::size_t i = 0; i < parts.size(); ++i)
    all = crc32_combine(all, parts[i], static_cast<z_off_t>(std::min(block_bytes, bytes - i * block_bytes)));
  return static_cast<std::uint32_t>(all);
}

std::uint32_t crc_of_metadata(const std::map<std::string, std::string>& metadata) {
  std::uint32_t all = 0;
  for (const auto& [key, value] : metadata) {
    if (key == kChecksums) continue;
    all = crc(key.c_str(), key.size() + 1, all);
    all = crc(value.c_str(), value.size() + 1, all);
  }
  return all;
}

std::string crc_text(std::uint32_t value) { return fmt::format("{:08x}", value); }

std::optional<std::uint32_t> crc_from(const nlohmann::json& value) {
  if (!value.is_string()) return std::nullopt;
  const auto& text = value.get_ref<const std::string&>();
  if (text.size() != 8 || text.find_first_not_of("0123456789abcdef") != std::string::npos) return std::nullopt;
  return static_cast<std::uint32_t>(std::stoul(text, nullptr, 16));
}

// Two levels of objects with one list inside are all that a header has; a key twice would hide what was checked. Not by
// the callback of the library's parse(): with one, each object that ends is looked for among all that are beside it.
class HeaderKeys : public nlohmann::json_sax<nlohmann::json> {
 public:
  std::vector<std::string> top;  // of the outer object
  bool too_deep = false;
  std::string error;

  bool null() override { return true; }
  bool boolean(bool) override { return true; }
  bool number_integer(number_integer_t) override { return true; }
  bool number_unsigned(number_unsigned_t) override { return true; }
  bool number_float(number_float_t, const string_t&) override { return true; }
  bool string(string_t&) override { return true; }
  bool binary(binary_t&) override { return true; }
  bool start_object(std::size_t) override { return start(); }
  bool start_array(std::size_t) override { return start(); }
  bool end_object() override { return --open_ >= 0; }
  bool end_array() override { return --open_ >= 0; }
  bool key(string_t& name) override {
    if (open_ == 1) top.push_back(name);
    return true;
  }
  bool parse_error(std::size_t, const std::string&, const nlohmann::json::exception& e) override {
    error = e.what();
    return false;
  }

 private:
  bool start() {
    too_deep = ++open_ > 4;
    return !too_deep;
  }
  int open_ = 0;
};

}  // namespace

const char* type_name(DType type) {
  for (const TypeName& t : kTypes) {
    if (t.type == type) return t.name;
  }
  return "?";
}

std::size_t size_of(DType type) {
  switch (type) {
    case DType::u8: return 1;
    case DType::f16:
    case DType::u16: return 2;
    case DType::f32:
    case DType::i32:
    case DType::u32: return 4;
    case DType::i64:
    case DType::u64:
    case DType::f64: return 8;
  }
  return 0;
}

void TensorWriter::metadata(const std::string& key, const std::string& value) { metadata_[key] = value; }

void TensorWriter::add(const std::string& name, DType type, std::vector<std::int64_t> shape, const void* data) {
  entries_.push_back({name, type, std::move(shape), data});
}

void TensorWriter::write(const std::string& file) const {
  // Widest types first: every tensor is then aligned to its own type in the file and in a mapping of it.
  std::vector<const Entry*> order;
  for (const Entry& entry : entries_) order.push_back(&entry);
  std::stable_sort(order.begin(), order.end(),
                   [](const Entry* a, const Entry* b) { return size_of(a->type) > size_of(b->type); });

  nlohmann::ordered_json header, checksums;
  auto metadata = nlohmann::json::parse(json_bytes(metadata_)).get<std::map<std::string, std::string>>();  // as UTF-8
  checksums[kMetadata] = crc_text(crc_of_metadata(metadata));
  for (const Entry* entry : order) {
    const std::size_t bytes = product(entry->shape) * size_of(entry->type);
    const auto* data = static_cast<const unsigned char*>(entry->data);
    checksums[entry->name] = crc_text(crc_of_blocks(
        bytes, kChecksumBlock, [&](std::size_t begin, std::size_t end) { return crc(data + begin, end - begin); }));
  }
  metadata[kChecksums] = json_bytes(checksums);
  header[kMetadata] = metadata;
  std::size_t offset = 0;
  for (const Entry* entry : order) {
    const std::size_t bytes = product(entry->shape) * size_of(entry->type);
    if (header.contains(entry->name))
      throw IoError(fmt::format("cannot write {}: two tensors are named {}", file, entry->name));
    header[entry->name] = {
        {"dtype", type_name(entry->type)}, {"shape", entry->shape}, {"data_offsets", {offset, offset + bytes}}};
    offset += bytes;
  }
  std::string text = json_bytes(header);
  text.append((64 - (text.size() + 8) % 64) % 64, ' ');  // data begins on a cache line
  AtomicFile out(file);
  const std::uint64_t length = text.size();
  out.write(&length, sizeof(length));
  out.write(text);
  for (const Entry* entry : order) out.write(entry->data, product(entry->shape) * size_of(entry->type));
  out.commit();
}

struct TensorReader::Impl {
  InputFile in;
  const std::string& file = in.name();
  const std::uint64_t size = in.size();
  std::map<std::string, std::string> metadata;
  std::map<std::string, Tensor> tensors;

  explicit Impl(const std::string& name) : in(name) {}

  [[noreturn]] void refuse(const std::string& why) const {
    throw InputError(fmt::format("{} is not a usable model file: {}", file, why));
  }

  void parse_header();
  void take_checksums();
  void check(const Tensor& tensor, std::uint32_t found) const;
  Tensor parse_tensor(const std::string& name, const nlohmann::json& entry, std::size_t data_bytes, std::size_t& begin,
                      std::size_t& end) const;
};

TensorReader::Tensor TensorReader::Impl::parse_tensor(const std::string& name, const nlohmann::json& entry,
                                                      std::size_t data_bytes, std::size_t& begin,
                                                      std::size_t& end) const {
  const auto broken = [&](const std::string& why) { refuse(fmt::format("tensor \"{}\" {}", name, why)); };
  if (!entry.is_object() || !entry.contains("dtype") || !entry.contains("shape") || !entry.contains("data_offsets")) {
    broken("lacks dtype, shape or data_offsets");
  }
  const nlohmann::json& dtype = entry["dtype"];
  const std::optional<DType> type = dtype.is_string() ? type_of(dtype.get<std::string>()) : std::nullopt;
  if (!type)
    broken(fmt::format("has dtype {}; supported are F16, F32, F64, I32, I64, U8, U16, U32, U64", dtype.dump()));
  const nlohmann::json& shape = entry["shape"];
  if (!shape.is_array() || shape.size() > kMaxRank) broken("has a shape that is not a list of at most 16 numbers");
  Tensor tensor{name, *type, {}, 0, size_of(*type), 1, {}};
  for (const nlohmann::json& d : shape) {
    if (!d.is_number_unsigned() || d.get<std::uint64_t>() > static_cast<std::uint64_t>(INT64_MAX))
      broken("has a shape with something else than non-negative whole numbers");
    const auto n = d.get<std::int64_t>();
    tensor.shape.push_back(n);
    if (__builtin_mul_overflow(tensor.count, n, &tensor.count))
      broken(fmt::format("has shape {}, which overflows", format_shape(tensor.shape)));
  }
  if (__builtin_mul_overflow(tensor.bytes, static_cast<std::size_t>(tensor.count), &tensor.bytes))
    broken("has a size that overflows");
  const nlohmann::json& offsets = entry["data_offsets"];
  if (!offsets.is_array() || offsets.size() != 2 || !offsets[0].is_number_unsigned() ||
      !offsets[1].is_number_unsigned()) {
    broken("has data_offsets that are not two non-negative whole numbers");
  }
  begin = offsets[0].get<std::size_t>();
  end = offsets[1].get<std::size_t>();
  if (begin > end) broken(fmt::format("has data_offsets [{}, {}] in the wrong order", begin, end));
  if (end > data_bytes) {
    broken(fmt::format("lies at bytes {} to {} of {} in the file: the file is truncated or damaged", begin, end,
                       data_bytes));
  }
  if (end - begin != tensor.bytes) {
    broken(fmt::format("holds {} bytes where {} of type {} need {}", end - begin, format_shape(tensor.shape),
                       type_name(*type), tensor.bytes));
  }
  return tensor;
}

void TensorReader::Impl::parse_header() {
  std::uint64_t length = 0;
  if (size == 0) refuse("it is empty");
  if (size < sizeof(length)) refuse("it has only a few bytes");
  in.read(&length, sizeof(length), 0);
  if (length > kMaxHeader || length > size - sizeof(length)) {
    refuse(
        fmt::format("it is no model (a safetensors file), or truncated: its header claims {} bytes and the file has {}",
                    length, size));
  }
  ask_memory(length * 32, file);  // what JSON becomes in memory, at most
  std::string text(static_cast<std::size_t>(length), '\0');
  in.read(text.data(), text.size(), sizeof(length));
  if (length == 0 || text[0] != '{') refuse("its header is not a JSON object");

  HeaderKeys keys;
  if (!nlohmann::json::sax_parse(text, &keys)) {
    if (keys.too_deep) refuse("its header is nested too deeply");
    refuse(fmt::format("its header is not valid JSON ({})", keys.error));
  }
  const nlohmann::json header = nlohmann::json::parse(text);
  if (!header.is_object()) refuse("its header is not a JSON object");
  std::sort(keys.top.begin(), keys.top.end());
  if (const auto twice = std::adjacent_find(keys.top.begin(), keys.top.end()); twice != keys.top.end())
    refuse(fmt::format("\"{}\" appears twice in its header", *twice));

  const std::size_t data_bytes = size - sizeof(length) - length;
  struct Extent {
    std::size_t begin, end;
    const std::string* name;
  };
  std::vector<Extent> extents;
  for (const auto& [name, entry] : header.items()) {
    if (name == kMetadata) {
      if (!entry.is_object()) refuse("its __metadata__ is not an object");
      for (const auto& [key, value] : entry.items()) {
        if (!value.is_string()) refuse(fmt::format("its metadata \"{}\" is not a text", key));
        metadata[key] = value.get<std::string>();
      }
      continue;
    }
    std::size_t begin = 0, end = 0;
    Tensor tensor = parse_tensor(name, entry, data_bytes, begin, end);
    tensor.position = sizeof(length) + length + begin;
    const auto where = tensors.emplace(name, std::move(tensor)).first;
    extents.push_back({begin, end, &where->first});
  }
  std::sort(extents.begin(), extents.end(),
            [](const Extent& a, const Extent& b) { return a.begin != b.begin ? a.begin < b.begin : a.end < b.end; });
  std::size_t reached = 0;
  const std::string* previous = nullptr;
  for (const Extent& extent : extents) {
    if (extent.begin < reached) refuse(fmt::format("tensors \"{}\" and \"{}\" overlap", *previous, *extent.name));
    if (extent.begin > reached) refuse(fmt::format("bytes {} to {} belong to no tensor", reached, extent.begin));
    reached = extent.end;
    previous = extent.name;
  }
  if (reached != data_bytes)
    refuse(fmt::format("{} bytes after the last tensor belong to no tensor", data_bytes - reached));
  take_checksums();
}

void TensorReader::Impl::take_checksums() {
  const auto listed = metadata.find(kChecksums);
  if (listed == metadata.end()) return;
  const nlohmann::json checksums = parse_json_or_discard(listed->second);
  if (!checksums.is_object() || checksums.size() != tensors.size() + 1)
    refuse("its header is damaged: it does not list a checksum for each tensor");
  const auto of = [&](const std::string& name) {
    const auto found = checksums.find(name);
    const std::optional<std::uint32_t> value = found == checksums.end() ? std::nullopt : crc_from(*found);
    if (!value) refuse(fmt::format("its header is damaged: it has no checksum of \"{}\"", name));
    return *value;
  };
  if (of(kMetadata) != crc_of_metadata(metadata)) refuse("its header is damaged: the checksum of its metadata differs");
  for (auto& [name, tensor] : tensors) tensor.checksum = of(name);
}

TensorReader::TensorReader(const std::string& file) : impl_(std::make_unique<Impl>(file)) { impl_->parse_header(); }

TensorReader::~TensorReader() = default;

const std::map<std::string, std::string>& TensorReader::metadata() const { return impl_->metadata; }
bool TensorReader::has(const std::string& name) const { return impl_->tensors.count(name) > 0; }
const std::string& TensorReader::file() const { return impl_->file; }

std::vector<std::string> TensorReader::names() const {
  std::vector<std::string> out;
  for (const auto& [name, tensor] : impl_->tensors) out.push_back(name);
  return out;
}

TensorReader::Tensor TensorReader::get(const std::string& name) const {
  const auto it = impl_->tensors.find(name);
  if (it == impl_->tensors.end())
    impl_->refuse(fmt::format("tensor \"{}\" is missing{}", name, did_you_mean(name, names())));
  return it->second;
}

TensorReader::Tensor TensorReader::get(const std::string& name, DType type,
                                       const std::vector<std::int64_t>& shape) const {
  Tensor tensor = get(name);
  bool fits = tensor.type == type && tensor.shape.size() == shape.size();
  for (std::size_t i = 0; fits && i < shape.size(); ++i) fits = shape[i] < 0 || shape[i] == tensor.shape[i];
  if (!fits) {
    impl_->refuse(fmt::format("tensor \"{}\" is {} {} where {} {} is expected", name, type_name(tensor.type),
                              format_shape(tensor.shape), type_name(type), format_shape(shape)));
  }
  return tensor;
}

void TensorReader::Impl::check(const Tensor& tensor, std::uint32_t found) const {
  if (tensor.checksum && *tensor.checksum != found)
    refuse(fmt::format("tensor \"{}\" is damaged: its checksum differs", tensor.name));
}

void TensorReader::read(const Tensor& tensor, void* to) const {
  auto* const bytes = static_cast<unsigned char*>(to);
  impl_->check(tensor, crc_of_blocks(tensor.bytes, kChecksumBlock, [&](std::size_t begin, std::size_t end) {
                 impl_->in.read(bytes + begin, end - begin, tensor.position + begin);
                 return tensor.checksum ? crc(bytes + begin, end - begin) : 0;
               }));
}

void TensorReader::read_blocks(const Tensor& tensor, std::int64_t block,
                               const std::function<void(const void*, std::int64_t, std::int64_t)>& body) const {
  const std::size_t size = size_of(tensor.type);
  const auto values = [size](std::size_t bytes) { return static_cast<std::int64_t>(bytes / size); };
  impl_->check(tensor, crc_of_blocks(tensor.bytes, static_cast<std::size_t>(block) * size,
                                     [&](std::size_t begin, std::size_t end) {
                                       std::vector<unsigned char> bytes(end - begin);
                                       impl_->in.read(bytes.data(), bytes.size(), tensor.position + begin);
                                       body(bytes.data(), values(begin), values(end - begin));
                                       return tensor.checksum ? crc(bytes.data(), bytes.size()) : 0;
                                     }));
}

void TensorReader::require_unchanged() const { impl_->in.require_unchanged(); }

}  // namespace octrad
