#include "app/paper/child.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>

#include "octrad/base/error.h"
#include "octrad/base/escape.h"
#include "octrad/base/interrupt.h"
#include "octrad/base/stopwatch.h"

namespace octrad::paper {
namespace {

struct Pipe {
  int read = -1, write = -1;
  Pipe() {
    int ends[2];
    if (pipe2(ends, O_CLOEXEC) != 0) throw IoError(fmt::format("cannot start a command: {}", std::strerror(errno)));
    read = ends[0];
    write = ends[1];
  }
  ~Pipe() {
    close_write();
    close(read);
  }
  void close_write() {
    if (write >= 0) close(write);
    write = -1;
  }
};

// In the new process: nothing here may allocate.
[[noreturn]] void become(char* const* arguments, const char* folder, int out, int err, pid_t parent) {
  setpgid(0, 0);  // Ctrl-C reaches the parent alone, which passes it on
  prctl(PR_SET_PDEATHSIG, SIGTERM);
  const int none = open("/dev/null", O_RDONLY);
  if (getppid() == parent && none >= 0 && dup2(none, STDIN_FILENO) >= 0 && dup2(out, STDOUT_FILENO) >= 0 &&
      dup2(err, STDERR_FILENO) >= 0 && chdir(folder) == 0)
    execv("/proc/self/exe", arguments);
  _exit(127);
}

// What is there to read; false at the end.
bool drain(int descriptor, std::string& to) {
  std::array<char, 1 << 14> buffer;
  const ssize_t n = read(descriptor, buffer.data(), buffer.size());
  if (n > 0) to.append(buffer.data(), static_cast<std::size_t>(n));
  return n > 0 || (n < 0 && (errno == EINTR || errno == EAGAIN));
}

std::string last_message(const std::string& err) {
  static const std::string kMark = "octrad: error: ";
  const std::size_t at = err.rfind(kMark);
  if (at == std::string::npos) return "";
  const std::size_t begin = at + kMark.size();
  return err.substr(begin, err.find('\n', begin) - begin);
}

void append(const std::string& file, const std::string& text) {
  const int descriptor = open(file.c_str(), O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0666);
  if (descriptor < 0) return;
  const ssize_t ignored = write(descriptor, text.data(), text.size());
  static_cast<void>(ignored);
  close(descriptor);
}

}  // namespace

ChildResult run_octrad(const std::vector<std::string>& words, const std::string& folder, const std::string& log,
                       const std::function<void()>& waiting) {
  std::vector<std::string> texts = {"octrad"};
  texts.insert(texts.end(), words.begin(), words.end());
  std::vector<char*> arguments;
  for (std::string& text : texts) arguments.push_back(text.data());
  arguments.push_back(nullptr);

  Pipe out, err;
  const Stopwatch watch;
  const pid_t parent = getpid(), child = fork();
  if (child < 0) throw IoError(fmt::format("cannot start a command: {}", std::strerror(errno)));
  if (child == 0) become(arguments.data(), folder.c_str(), out.write, err.write, parent);
  out.close_write();
  err.close_write();

  ChildResult result;
  std::string messages;
  bool out_open = true, err_open = true, told = false;
  while (out_open || err_open) {
    std::array<pollfd, 2> ready = {pollfd{out_open ? out.read : -1, POLLIN, 0},
                                   pollfd{err_open ? err.read : -1, POLLIN, 0}};
    poll(ready.data(), ready.size(), 200);
    if (ready[0].revents != 0) out_open = drain(out.read, result.out);
    if (ready[1].revents != 0) err_open = drain(err.read, messages);
    if (interrupted() && !told) {
      kill(child, SIGTERM);
      told = true;
    }
    waiting();
  }
  int status = 0;
  struct rusage usage {};
  while (wait4(child, &status, 0, &usage) < 0 && errno == EINTR) {
  }
  result.seconds = watch.seconds();
  result.peak_bytes = static_cast<double>(usage.ru_maxrss) * 1024.0;
  result.exit_code = WIFSIGNALED(status) ? 128 + WTERMSIG(status) : WEXITSTATUS(status);
  result.message = last_message(messages);
  if (WIFSIGNALED(status))
    result.message = fmt::format("ended by signal {} ({})", WTERMSIG(status), strsignal(WTERMSIG(status)));
  else if (!result.ok() && result.message.empty())
    result.message = fmt::format("ended with exit code {}", result.exit_code);
  append(log, fmt::format("+ octrad {}\n{}", shell_text(words), messages));
  return result;
}

}  // namespace octrad::paper
