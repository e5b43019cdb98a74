// Files that are read, in parts or as a whole.
#pragma once

#include <cstdint>
#include <ctime>
#include <string>

namespace octrad {

// A regular file, opened for reading: pipes and devices, which would wait or never end, are refused. All functions
// throw IoError with the file's name and the system's reason. Nothing is mapped: a file that gets shorter while it is
// read is such an error, not a signal.
class InputFile {
 public:
  explicit InputFile(const std::string& file);
  ~InputFile();
  InputFile(const InputFile&) = delete;
  InputFile& operator=(const InputFile&) = delete;

  const std::string& name() const { return name_; }
  std::uint64_t size() const { return size_; }  // when it was opened
  // The bytes [offset, offset + bytes), all of them. Thread-safe.
  void read(void* to, std::size_t bytes, std::uint64_t offset) const;
  // Throws when the file was written after it was opened: what was read may be of two versions.
  void require_unchanged() const;

 private:
  std::string name_;
  int descriptor_ = -1;
  std::uint64_t size_ = 0;
  timespec modified_{};
};

// The whole content of a regular file; the memory budget is asked first. Throws IoError or MemoryError, naming the
// file.
std::string read_file(const std::string& file);

}  // namespace octrad
