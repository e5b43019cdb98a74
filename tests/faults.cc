// Faults of files, refused threads and jumps of the clock for tests/cli: preloaded into the program (LD_PRELOAD),
// instead of the functions of the C library with these names.
//
// OCTRAD_FAULTS   rules with ";" between them, "FOLDER:CALL:ERROR:FIRST:COUNT": the FIRST call (from 1) of files under
//                 FOLDER and the COUNT - 1 after it (0: all) fail. CALL: open (a new file for writing), tmpfile (the
//                 same, of those without a name), input (opening a file for reading), access (may it be written?),
//                 write, short (write takes half of it, and does not fail), fsync, close, link, rename, flock, read,
//                 shortread; whatever FOLDER: map (memory for tables), thread (a new thread), threads (the same, but
//                 from FIRST at once, not counting the program's own: a limit of the user). ERROR: the number of errno.
//                 hang (a read that never ends) needs none.
// OCTRAD_PROCESSORS   how many processors the system says that it has.
// OCTRAD_CLOCK    seconds by which the time of day jumps forth and back, call by call. The steady clock goes on.
#include <dlfcn.h>
#include <fcntl.h>
#include <limits.h>
#include <pthread.h>
#include <sched.h>
#include <stdarg.h>
#include <sys/file.h>
#include <sys/mman.h>
#include <sys/time.h>
#include <time.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <memory>

namespace {

struct Rule {
  char folder[PATH_MAX] = {}, call[16] = {};
  int error = 0, first = 1, count = 0;
  std::atomic<int> calls{0};
};
constinit Rule g_rules[8];  // before the constructor runs
int g_rule_count = 0;
long g_jump = 0;
int g_processors = 0;
std::atomic<bool> g_watched[1024][8];  // files under the rules' folders, by descriptor

template <typename Function>
Function* next(const char* name) {
  return reinterpret_cast<Function*>(dlsym(RTLD_NEXT, name));
}

__attribute__((constructor)) void read_environment() {
  if (const char* jump = getenv("OCTRAD_CLOCK")) g_jump = atol(jump);
  if (const char* processors = getenv("OCTRAD_PROCESSORS")) g_processors = atoi(processors);
  const char* rules = getenv("OCTRAD_FAULTS");
  while (rules != nullptr && *rules != '\0' && g_rule_count < 8) {
    Rule& rule = g_rules[g_rule_count];
    if (sscanf(rules, "%4095[^:]:%15[^:]:%d:%d:%d", rule.folder, rule.call, &rule.error, &rule.first, &rule.count) !=
        5) {
      fprintf(stderr, "OCTRAD_FAULTS: cannot read \"%s\"\n", rules);
      abort();
    }
    ++g_rule_count;
    rules = strchr(rules, ';');
    if (rules != nullptr) ++rules;
  }
}

bool is_under(const char* path, int rule) {
  return path != nullptr && strncmp(path, g_rules[rule].folder, strlen(g_rules[rule].folder)) == 0;
}

// Whether the call number of this rule is one that fails; sets errno.
bool rule_fails(int rule, const char* call) {
  Rule& r = g_rules[rule];
  if (strcmp(r.call, call) != 0) return false;
  const int n = ++r.calls;
  if (n < r.first || (r.count > 0 && n >= r.first + r.count)) return false;
  errno = r.error;
  return true;
}
bool fails(const char* path, const char* call) {
  for (int i = 0; i < g_rule_count; ++i) {
    if (is_under(path, i) && rule_fails(i, call)) return true;
  }
  return false;
}
bool fails(int descriptor, const char* call) {
  for (int i = 0; i < g_rule_count && descriptor >= 0 && descriptor < 1024; ++i) {
    if (g_watched[descriptor][i] && rule_fails(i, call)) return true;
  }
  return false;
}

template <typename Open>
int open_watched(const char* path, int flags, const Open& open) {
  const bool unnamed = (flags & O_TMPFILE) == O_TMPFILE;
  if (unnamed && fails(path, "tmpfile")) return -1;
  if ((unnamed || (flags & O_EXCL) != 0) && fails(path, "open")) return -1;
  if ((flags & (O_ACCMODE | O_CREAT | O_DIRECTORY)) == O_RDONLY && fails(path, "input")) return -1;
  const int descriptor = open();
  for (int i = 0; i < g_rule_count && descriptor >= 0 && descriptor < 1024; ++i)
    g_watched[descriptor][i] = is_under(path, i);
  return descriptor;
}

mode_t mode_of(int flags, va_list arguments) {
  return (flags & O_CREAT) != 0 || (flags & O_TMPFILE) == O_TMPFILE ? static_cast<mode_t>(va_arg(arguments, int)) : 0;
}

// Threads besides the first one: each counts from when it is asked for until its work has ended.
std::atomic<int> g_threads{0};
struct Counted {
  void* (*work)(void*);
  void* argument;
};
void* run_counted(void* counted) {
  const Counted thread = *std::unique_ptr<Counted>(static_cast<Counted*>(counted));
  struct Leave {
    ~Leave() { --g_threads; }
  } const leave;
  return thread.work(thread.argument);
}
// Whether one more is too many.
bool refused() {
  const int n = ++g_threads;
  for (int i = 0; i < g_rule_count; ++i) {
    if (rule_fails(i, "thread")) return true;
    if (strcmp(g_rules[i].call, "threads") != 0 || n < g_rules[i].first) continue;
    errno = g_rules[i].error;
    return true;
  }
  return false;
}

long jump() {
  static std::atomic<unsigned> calls{0};
  return g_jump == 0 ? 0 : ++calls % 2 == 0 ? g_jump : -g_jump;
}

}  // namespace

extern "C" {

int open(const char* path, int flags, ...) {
  va_list arguments;
  va_start(arguments, flags);
  const mode_t mode = mode_of(flags, arguments);
  va_end(arguments);
  return open_watched(path, flags, [&] { return next<int(const char*, int, ...)>("open")(path, flags, mode); });
}

int open64(const char* path, int flags, ...) {
  va_list arguments;
  va_start(arguments, flags);
  const mode_t mode = mode_of(flags, arguments);
  va_end(arguments);
  return open_watched(path, flags, [&] { return next<int(const char*, int, ...)>("open64")(path, flags, mode); });
}

int access(const char* path, int mode) noexcept {
  if ((mode & W_OK) != 0 && fails(path, "access")) return -1;
  return next<int(const char*, int)>("access")(path, mode);
}

ssize_t write(int descriptor, const void* data, size_t bytes) {
  if (fails(descriptor, "write")) return -1;
  if (bytes > 1 && fails(descriptor, "short")) bytes /= 2;
  return next<ssize_t(int, const void*, size_t)>("write")(descriptor, data, bytes);
}

ssize_t pread(int descriptor, void* data, size_t bytes, off_t offset) {
  while (fails(descriptor, "hang")) pause();
  if (fails(descriptor, "read")) return -1;
  if (bytes > 1 && fails(descriptor, "shortread")) bytes /= 2;
  return next<ssize_t(int, void*, size_t, off_t)>("pread")(descriptor, data, bytes, offset);
}

ssize_t read(int descriptor, void* data, size_t bytes) {
  while (fails(descriptor, "hang")) pause();
  if (fails(descriptor, "read")) return -1;
  if (bytes > 1 && fails(descriptor, "shortread")) bytes /= 2;
  return next<ssize_t(int, void*, size_t)>("read")(descriptor, data, bytes);
}

int fsync(int descriptor) { return fails(descriptor, "fsync") ? -1 : next<int(int)>("fsync")(descriptor); }

int close(int descriptor) {  // as file systems over a network: it is closed, and what was written is lost
  const bool failed = fails(descriptor, "close");
  const int error = errno, result = next<int(int)>("close")(descriptor);
  if (descriptor >= 0 && descriptor < 1024) {
    for (std::atomic<bool>& watched : g_watched[descriptor]) watched = false;
  }
  if (!failed) return result;
  errno = error;
  return -1;
}

int flock(int descriptor, int operation) noexcept {
  return fails(descriptor, "flock") ? -1 : next<int(int, int)>("flock")(descriptor, operation);
}

int linkat(int from_folder, const char* from, int to_folder, const char* to, int flags) noexcept {
  return fails(to, "link")
             ? -1
             : next<int(int, const char*, int, const char*, int)>("linkat")(from_folder, from, to_folder, to, flags);
}

int rename(const char* from, const char* to) noexcept {
  return fails(to, "rename") ? -1 : next<int(const char*, const char*)>("rename")(from, to);
}

void* mmap(void* address, size_t bytes, int protection, int flags, int descriptor, off_t offset) noexcept {
  for (int i = 0; i < g_rule_count && (flags & MAP_NORESERVE) != 0 && (protection & PROT_WRITE) != 0; ++i) {
    if (rule_fails(i, "map")) return MAP_FAILED;
  }
  using Map = void*(void*, size_t, int, int, int, off_t);
  return next<Map>("mmap")(address, bytes, protection, flags, descriptor, offset);
}

int pthread_create(pthread_t* thread, const pthread_attr_t* attributes, void* (*work)(void*), void* argument) noexcept {
  using Create = int(pthread_t*, const pthread_attr_t*, void* (*)(void*), void*);
  int error = 0;
  if (refused()) {
    error = errno;
  } else {
    std::unique_ptr<Counted> counted(new Counted{work, argument});
    error = next<Create>("pthread_create")(thread, attributes, run_counted, counted.get());
    if (error == 0) counted.release();
  }
  if (error != 0) --g_threads;
  return error;
}

int sched_getaffinity(pid_t process, size_t bytes, cpu_set_t* set) noexcept {
  const int result = next<int(pid_t, size_t, cpu_set_t*)>("sched_getaffinity")(process, bytes, set);
  if (result != 0 || g_processors == 0) return result;
  CPU_ZERO_S(bytes, set);
  for (int i = 0; i < g_processors; ++i) CPU_SET_S(i, bytes, set);
  return result;
}

long sysconf(int name) noexcept {
  const bool processors = name == _SC_NPROCESSORS_ONLN || name == _SC_NPROCESSORS_CONF;
  return processors && g_processors > 0 ? g_processors : next<long(int)>("sysconf")(name);
}

int clock_gettime(clockid_t clock, timespec* time) noexcept {
  const int result = next<int(clockid_t, timespec*)>("clock_gettime")(clock, time);
  if (clock == CLOCK_REALTIME) time->tv_sec += jump();
  return result;
}

int gettimeofday(timeval* time, void* zone) noexcept {
  const int result = next<int(timeval*, void*)>("gettimeofday")(time, zone);
  time->tv_sec += jump();
  return result;
}

time_t time(time_t* out) noexcept {
  const time_t now = next<time_t(time_t*)>("time")(nullptr) + jump();
  if (out != nullptr) *out = now;
  return now;
}

}  // extern "C"
