// Files that are either the old one or the complete new one, whatever happens in between.
#pragma once

#include <cstddef>
#include <memory>
#include <string>

namespace octrad {

// Writes to a file without a name where the system has such (O_TMPFILE), else to a new one beside `file`; commit()
// syncs it to disk and renames it over `file`. Without commit() (an exception, a killed program) the old file stays,
// and nothing is left of the new one; where the system has no files without a name, a killed program leaves
// `file`.octrad-XXXXXX.tmp. No existing file is ever opened for writing, so that two writers never mix; the last to
// commit() wins. A `file` that exists and is not a regular file
// (/dev/null, a pipe) is written directly. All functions throw IoError with the file's name and the system's reason.
class AtomicFile {
 public:
  explicit AtomicFile(const std::string& file);
  ~AtomicFile();
  AtomicFile(const AtomicFile&) = delete;
  AtomicFile& operator=(const AtomicFile&) = delete;

  void write(const void* data, std::size_t bytes);
  void write(const std::string& text) { write(text.data(), text.size()); }
  void commit();

 private:
  std::string file_;
  std::string temporary_;  // empty while the new file has no name
  int descriptor_ = -1;
  bool direct_ = false;
};

// Keeps other processes from writing the same result: holds an exclusive lock on `file`.lock, which is removed at the
// end (a killed program leaves it, without the lock). Throws IoError at once when another process holds it.
class WriterLock {
 public:
  explicit WriterLock(const std::string& file);
  // Null when another process holds it.
  static std::unique_ptr<WriterLock> try_to_take(const std::string& file);
  ~WriterLock();
  WriterLock(const WriterLock&) = delete;
  WriterLock& operator=(const WriterLock&) = delete;

 private:
  WriterLock() = default;
  bool take(const std::string& file);

  std::string lock_;
  int descriptor_ = -1;
};

// Throws IoError unless `file` could be written: its folder exists and is writable, and it is not a folder itself.
// Call before long work whose result goes there.
void require_writable(const std::string& file);

}  // namespace octrad
