#include "octrad/base/atomic_file.h"

#include <dirent.h>
#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <climits>
#include <cstdio>
#include <cstring>
#include <ctime>
#include <filesystem>
#include <iterator>
#include <string_view>
#include <utility>
#include <vector>

#include "octrad/base/error.h"
#include "octrad/base/log.h"
#include "octrad/base/random_seed.h"

namespace octrad {
namespace {

[[noreturn]] void fail(const char* what, const std::string& file, int error) {
  throw IoError(fmt::format("cannot {} {}: {}", what, file, std::strerror(error)));
}

std::string folder_of(const std::string& file) {
  const std::string folder = std::filesystem::path(file).parent_path().string();
  return folder.empty() ? "." : folder;
}

// Follows symbolic links, so that the rename replaces what they point to, or makes it, and not the link.
std::string resolve(const std::string& file) {
  struct stat info {};
  if (lstat(file.c_str(), &info) != 0 || !S_ISLNK(info.st_mode)) return file;
  if (stat(file.c_str(), &info) == 0) {
    std::error_code error;
    const std::filesystem::path target = std::filesystem::canonical(file, error);
    return S_ISREG(info.st_mode) && !error ? target.string() : file;  // /dev/stdout points to what has no name
  }
  std::filesystem::path path = file;
  for (int links = 0; lstat(path.c_str(), &info) == 0 && S_ISLNK(info.st_mode); ++links) {
    std::error_code error;
    const std::filesystem::path target = std::filesystem::read_symlink(path, error);
    if (error || links == 40) fail("write", file, error ? error.value() : ELOOP);
    path = path.parent_path() / target;
  }
  return path.string();
}

// A name in the folder of `file` that nobody uses yet, most likely; short, whatever the length of the file's name.
std::string unused_name(const std::string& file) {
  static std::atomic<unsigned> count = 0;
  return fmt::format("{}/.octrad-{:08x}{:04x}.tmp", folder_of(file), random_seed() & 0xffffffffu, ++count & 0xffffu);
}

bool is_temporary_name(const std::string& name) {
  constexpr std::string_view before = ".octrad-", after = ".tmp";
  return name.size() == before.size() + 12 + after.size() && name.compare(0, before.size(), before) == 0 &&
         name.compare(name.size() - after.size(), after.size(), after) == 0 &&
         name.find_first_not_of("0123456789abcdef", before.size()) == name.size() - after.size();
}

// Removes the new files in the folder of `file` whose writers were killed while those had a name: whoever writes one
// holds a lock (flock) on it. What cannot be opened or locked stays, and what was written to in the last hour: some
// file systems that machines share keep such locks on one machine alone.
void remove_abandoned(const std::string& file) {
  const std::string folder = folder_of(file);
  std::vector<std::string> names;
  if (DIR* entries = opendir(folder.c_str())) {
    while (const dirent* entry = readdir(entries)) {
      if (is_temporary_name(entry->d_name)) names.push_back(folder + "/" + entry->d_name);
    }
    closedir(entries);
  }
  for (const std::string& name : names) {
    const int descriptor = open(name.c_str(), O_WRONLY | O_NOFOLLOW | O_CLOEXEC | O_NONBLOCK);
    struct stat info {};
    if (descriptor >= 0 && fstat(descriptor, &info) == 0 && S_ISREG(info.st_mode) &&
        info.st_mtime < std::time(nullptr) - 3600 && flock(descriptor, LOCK_EX | LOCK_NB) == 0)
      unlink(name.c_str());
    if (descriptor >= 0) close(descriptor);
  }
}

struct Closer {
  int descriptor;
  ~Closer() {
    if (descriptor >= 0) close(descriptor);
  }
};

// The names of new files, for a signal handler, which may neither allocate nor wait: in fixed memory.
struct Slot {
  std::atomic<bool> taken{false}, filled{false};
  char name[PATH_MAX];
};
Slot g_slots[16];

// The slot that holds `name` from now on; -1 where there is none free.
int take_slot(const std::string& name) {
  for (int i = 0; i < static_cast<int>(std::size(g_slots)) && name.size() < PATH_MAX; ++i) {
    if (g_slots[i].taken.exchange(true)) continue;
    std::memcpy(g_slots[i].name, name.c_str(), name.size() + 1);
    g_slots[i].filled.store(true);
    return i;
  }
  return -1;
}

void free_slot(int& slot) {
  if (slot < 0) return;
  g_slots[slot].filled.store(false);
  g_slots[std::exchange(slot, -1)].taken.store(false);
}

// A new file with a name, never one that is there or that a link points to, and the lock on it. Sets `opened` to the
// name where it worked.
int open_new(const std::string& file, std::string& opened) {
  for (;;) {
    const std::string name = unused_name(file);
    const int descriptor = open(name.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, 0666);
    if (descriptor < 0) return descriptor;
    opened = name;
    struct stat info {};
    if (flock(descriptor, LOCK_EX) != 0 || fstat(descriptor, &info) != 0 || info.st_nlink > 0) return descriptor;
    close(descriptor);  // remove_abandoned() of another process had the lock first
  }
}

}  // namespace

AtomicFile::AtomicFile(const std::string& file) : name_(file) {
  require_writable(file);
  file_ = resolve(file);
  struct stat info {};
  direct_ = stat(file_.c_str(), &info) == 0 && !S_ISREG(info.st_mode);
  if (direct_) {
    descriptor_ = open(file_.c_str(), O_WRONLY | O_CLOEXEC | O_NONBLOCK | O_NOCTTY);  // a pipe must not be waited for
    if (descriptor_ < 0 && errno == ENXIO)
      throw IoError(fmt::format("cannot write {}: it is a pipe that nobody reads", file));
    if (descriptor_ >= 0) fcntl(descriptor_, F_SETFL, fcntl(descriptor_, F_GETFL) & ~O_NONBLOCK);
  } else {
    if (access("/proc/self/fd", X_OK) == 0)  // commit() needs it
      descriptor_ = open(folder_of(file_).c_str(), O_TMPFILE | O_WRONLY | O_CLOEXEC, 0666);
    if (descriptor_ < 0) {
      std::string name;
      descriptor_ = open_new(file_, name);
      if (descriptor_ >= 0) name_temporary(name);
    }
  }
  if (descriptor_ < 0) fail("write", file, errno);
}

AtomicFile::~AtomicFile() {
  if (descriptor_ >= 0) close(descriptor_);
  if (temporary_.empty()) return;
  unlink(temporary_.c_str());
  forget_temporary();
}

void AtomicFile::name_temporary(const std::string& name) {
  temporary_ = name;
  slot_ = take_slot(name);
}

void AtomicFile::forget_temporary() {
  temporary_.clear();
  free_slot(slot_);
}

void write_file(const std::string& file, const std::string& bytes) {
  AtomicFile out(file);
  out.write(bytes);
  out.commit();
}

void remove_temporary_files() {
  for (const Slot& slot : g_slots) {
    if (slot.filled.load()) unlink(slot.name);
  }
}

void AtomicFile::write(const void* data, std::size_t bytes) {
  synced_ = false;
  const char* p = static_cast<const char*>(data);
  while (bytes > 0) {
    const ssize_t n = ::write(descriptor_, p, std::min<std::size_t>(bytes, std::size_t{1} << 30));
    if (n < 0) {
      if (errno == EINTR) continue;
      fail("write", name_, errno);
    }
    p += n;
    bytes -= static_cast<std::size_t>(n);
  }
}

void AtomicFile::sync() {
  // EINVAL: a file system that cannot sync
  if (!direct_ && !synced_ && fsync(descriptor_) != 0 && errno != EINVAL) fail("write", name_, errno);
  synced_ = true;
}

void AtomicFile::prepare() {
  sync();
  if (direct_ || !temporary_.empty()) return;
  // The only way to give it a name; it must be a new one, which is then renamed. Without locks nobody removes it.
  flock(descriptor_, LOCK_EX | LOCK_NB);
  const std::string self = fmt::format("/proc/self/fd/{}", descriptor_);
  std::string name = unused_name(file_);
  while (linkat(AT_FDCWD, self.c_str(), AT_FDCWD, name.c_str(), AT_SYMLINK_FOLLOW) != 0) {
    if (errno != EEXIST) fail("write", name_, errno);
    name = unused_name(file_);
  }
  name_temporary(name);
}

void AtomicFile::commit() {
  prepare();
  const Closer holds_lock{direct_ ? -1 : fcntl(descriptor_, F_DUPFD_CLOEXEC, 0)};  // until the file has its name
  if (close(std::exchange(descriptor_, -1)) != 0) fail("write", name_, errno);
  if (direct_) return;
  if (std::rename(temporary_.c_str(), file_.c_str()) != 0) fail("replace", name_, errno);
  forget_temporary();
  // The new name itself must survive a power failure too. Not every file system can sync a folder: best effort.
  const int folder = open(folder_of(file_).c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (folder >= 0) {
    fsync(folder);
    close(folder);
  }
}

WriterLock::WriterLock(const std::string& file) {
  if (!take(file))
    throw IoError(fmt::format("cannot write {}: another process is writing it (it holds {})", file, lock_));
}

std::unique_ptr<WriterLock> WriterLock::try_to_take(const std::string& file) {
  std::unique_ptr<WriterLock> lock(new WriterLock);
  if (!lock->take(file)) lock.reset();
  return lock;
}

bool WriterLock::take(const std::string& file) {
  require_writable(file);
  struct stat info {};
  if (stat(file.c_str(), &info) == 0 && !S_ISREG(info.st_mode)) return true;  // /dev/null
  remove_abandoned(resolve(file));
  lock_ = resolve(file) + ".lock";
  for (int tries = 0;; ++tries) {
    descriptor_ = open(lock_.c_str(), O_RDWR | O_CREAT | O_NOFOLLOW | O_CLOEXEC | O_NONBLOCK, 0666);
    if (descriptor_ < 0) descriptor_ = open(lock_.c_str(), O_RDONLY | O_NOFOLLOW | O_CLOEXEC | O_NONBLOCK);
    if (descriptor_ < 0 || flock(descriptor_, LOCK_EX | LOCK_NB) != 0) {
      const int error = errno;
      if (descriptor_ >= 0) close(std::exchange(descriptor_, -1));
      if (error == EWOULDBLOCK) return false;
      if (error == ENOENT) fail("write", file, error);  // the working directory was removed
      log_warning(
          fmt::format("{}: {}; nothing keeps another process from writing {} too", lock_, std::strerror(error), file));
      return true;
    }
    // Whoever held it before may have removed the file in between.
    struct stat mine {
    }, there{};
    if (fstat(descriptor_, &mine) == 0 && stat(lock_.c_str(), &there) == 0 && mine.st_ino == there.st_ino &&
        mine.st_dev == there.st_dev) {
      if (mine.st_size > 0) {  // a lock is empty: this is a file of somebody's own
        close(std::exchange(descriptor_, -1));
        throw IoError(fmt::format("cannot write {}: {} is in the way, which is no lock of octrad's", file, lock_));
      }
      slot_ = take_slot(lock_);
      return true;
    }
    if (tries == 100) return true;  // a file system whose numbers of files change: what is locked is the best there is
    close(std::exchange(descriptor_, -1));
  }
}

WriterLock::~WriterLock() {
  if (descriptor_ < 0) return;
  unlink(lock_.c_str());
  free_slot(slot_);
  close(descriptor_);
}

void require_writable(const std::string& file) {
  if (file.empty()) throw IoError("cannot write: the file name is empty");
  struct stat info {};
  if (stat(file.c_str(), &info) == 0) {
    if (S_ISDIR(info.st_mode)) throw IoError(fmt::format("cannot write {}: it is a folder", file));
    if (access(file.c_str(), W_OK) != 0) fail("write", file, errno);
    if (!S_ISREG(info.st_mode)) return;
  } else if (errno != ENOENT && errno != ENOTDIR) {
    fail("write", file, errno);  // a name that is too long, links in a circle
  }
  const std::string folder = folder_of(resolve(file));
  if (stat(folder.c_str(), &info) != 0)
    throw IoError(fmt::format("cannot write {}: folder {} does not exist", file, folder));
  if (!S_ISDIR(info.st_mode)) throw IoError(fmt::format("cannot write {}: {} is not a folder", file, folder));
  if (access(folder.c_str(), W_OK | X_OK) != 0) fail("write", file, errno);
}

}  // namespace octrad
