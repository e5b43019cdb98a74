// Files that are either the old one or the complete new one, whatever happens in between.
#pragma once

#include <cstddef>
#include <memory>
#include <string>

namespace octrad {

// Writes to a file without a name where the system has such (O_TMPFILE), else to a new one beside `file`; commit()
// syncs it to disk and renames it over `file`. Without commit() (an exception, a killed program) the old file stays,
// and nothing is left of the new one, but for kill -9 between naming and renaming, or where the system has no files
// without a name: .octrad-XXXXXXXXXXXX.tmp stays in that folder until a WriterLock is taken there. No existing file is
// ever opened for writing, so that two writers never mix; the last to commit() wins. A symbolic link stays, and what it
// points to is replaced or made. A `file` that exists and is not a regular file (/dev/null, a pipe that somebody reads)
// is written directly. Permissions are those of a new file (umask). All functions throw IoError with the file's name
// and the system's reason.
class AtomicFile {
 public:
  explicit AtomicFile(const std::string& file);
  ~AtomicFile();
  AtomicFile(const AtomicFile&) = delete;
  AtomicFile& operator=(const AtomicFile&) = delete;

  void write(const void* data, std::size_t bytes);
  void write(const std::string& text) { write(text.data(), text.size()); }
  // What was written is on the disk, and, after prepare(), the new file has a name and waits for nothing but commit():
  // of several files that belong together all can be so far before the first one takes the place of the old one.
  void sync();
  void prepare();
  void commit();

 private:
  void name_temporary(const std::string& name);
  void forget_temporary();

  std::string name_, file_;  // as given, and where its links lead to
  std::string temporary_;    // empty while the new file has no name
  int slot_ = -1;            // of the list that remove_temporary_files() reads
  int descriptor_ = -1;
  bool direct_ = false, synced_ = false;
};

// A whole file at once, by an AtomicFile.
void write_file(const std::string& file, const std::string& bytes);

// For a signal handler that ends the process: removes the new files that have a name already, and locks.
void remove_temporary_files();

// Keeps other processes from writing the same result: holds an exclusive lock (flock) on `file`.lock, which is removed
// at the end (kill -9 leaves it, without the lock). Removes what killed writers left of new files in that folder.
// Throws IoError at once when another process holds it, or when that name is a file with something in it. Where there
// can be no lock (a file system without locks, a name that is too long) there is a warning, and no lock.
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
  int slot_ = -1;  // of the list that remove_temporary_files() reads
  int descriptor_ = -1;
};

// Throws IoError unless `file` could be written: its folder exists and is writable, and it is not a folder itself.
// Call before long work whose result goes there.
void require_writable(const std::string& file);

}  // namespace octrad
