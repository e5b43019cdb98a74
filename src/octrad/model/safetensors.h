// Reading and writing safetensors files (docs/formats.md), memory-bounded: tensors are streamed to and from the file.
// Files that are written hold checksums of their tensors and metadata, by which damage is found when they are read.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace octrad {

enum class DType { f32, f16, i32, i64, u8, u16, u32, u64, f64 };
std::size_t size_of(DType type);
const char* type_name(DType type);  // as in files: "F32"

// Collects views of tensors (the memory must stay valid until write()), then writes them in one pass.
class TensorWriter {
 public:
  void metadata(const std::string& key, const std::string& value);
  void add(const std::string& name, DType type, std::vector<std::int64_t> shape, const void* data);
  // Writes a new file, syncs and renames: the old file survives any failure. Throws IoError.
  void write(const std::string& file) const;

 private:
  struct Entry {
    std::string name;
    DType type;
    std::vector<std::int64_t> shape;
    const void* data;
  };
  std::vector<Entry> entries_;
  std::map<std::string, std::string> metadata_;
};

class TensorReader {
 public:
  // Opens the file and checks the whole header (sizes, offsets, overlaps, overflow, the checksum of the metadata).
  // Throws IoError or InputError.
  explicit TensorReader(const std::string& file);
  ~TensorReader();
  const std::map<std::string, std::string>& metadata() const;
  bool has(const std::string& name) const;
  std::vector<std::string> names() const;
  struct Tensor {
    std::string name;
    DType type;
    std::vector<std::int64_t> shape;
    std::uint64_t position;  // of its first byte in the file
    std::size_t bytes;
    std::int64_t count;
    std::optional<std::uint32_t> checksum;  // none: of a file without
  };
  // Throws InputError naming the tensor when it is missing, or when type or shape (-1: any) differ.
  Tensor get(const std::string& name) const;
  Tensor get(const std::string& name, DType type, const std::vector<std::int64_t>& shape) const;
  // Copies a tensor from the file. Throws IoError, also when the file has become shorter, and InputError when the
  // tensor is damaged.
  void read(const Tensor& tensor, void* to) const;
  // The same in blocks of `block` values, in any order and from several threads: body(values, first, count).
  void read_blocks(const Tensor& tensor, std::int64_t block,
                   const std::function<void(const void*, std::int64_t, std::int64_t)>& body) const;
  // After the last tensor: throws IoError when the file was written in the meantime.
  void require_unchanged() const;
  const std::string& file() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace octrad
