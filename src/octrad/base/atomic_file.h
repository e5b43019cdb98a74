// Files that are either the old one or the complete new one, whatever happens in between.
#pragma once

#include <cstddef>
#include <string>

namespace octrad {

// Writes to `file`.tmp; commit() syncs it to disk and renames it over `file`. Without commit() (an exception, say) the
// temporary file is removed and the old file stays. A `file` that exists and is not a regular file (/dev/null, a pipe)
// is written directly. All functions throw IoError with the file's name and the system's reason.
class AtomicFile {
 public:
  explicit AtomicFile(const std::string& file);
  ~AtomicFile();
  AtomicFile(const AtomicFile&) = delete;
  AtomicFile& operator=(const AtomicFile&) = delete;

  void write(const void* data, std::size_t bytes);
  void write(const std::string& text) { write(text.data(), text.size()); }
  void commit();
  // Where the bytes go until commit(), for libraries that want to write to a path themselves.
  const std::string& temporary() const { return temporary_; }

 private:
  std::string file_, temporary_;
  int descriptor_ = -1;
  bool direct_ = false;
};

// Throws IoError unless `file` could be written: its folder exists and is writable, and it is not a folder itself.
// Call before long work whose result goes there.
void require_writable(const std::string& file);

// Whole content of a file. Throws IoError.
std::string read_text_file(const std::string& file);
// Replaces `file` by `text`, atomically.
void write_text_file(const std::string& file, const std::string& text);

}  // namespace octrad
