#include "octrad/base/interrupt.h"

#include <poll.h>
#include <signal.h>
#include <unistd.h>

#include <atomic>
#include <cstddef>

#include "octrad/base/atomic_file.h"

namespace octrad {
namespace {
std::atomic<bool> g_interrupted{false}, g_deferred{false};
static_assert(std::atomic<bool>::is_always_lock_free, "used in a signal handler");

template <std::size_t N>
[[noreturn]] void end_at_once(const char (&message)[N]) {
  remove_temporary_files();
  pollfd there = {STDERR_FILENO, POLLOUT, 0};
  if (poll(&there, 1, 0) == 1) {  // a full pipe would hold the process here
    const ssize_t ignored = write(STDERR_FILENO, message, N - 1);
    static_cast<void>(ignored);
  }
  _exit(130);
}

void on_signal(int signal) {
  if (!g_deferred.load()) end_at_once("\noctrad: interrupted before there was anything to save\n");
  if (g_interrupted.exchange(true) && signal != SIGHUP)
    end_at_once("\noctrad: stopped at once by a second signal; nothing more was saved\n");
}
}  // namespace

void install_interrupt_handler() {
  g_deferred.store(false);
  struct sigaction action {};
  action.sa_handler = on_signal;
  sigemptyset(&action.sa_mask);
  action.sa_flags = SA_RESTART;
  sigaction(SIGINT, &action, nullptr);
  sigaction(SIGTERM, &action, nullptr);
  struct sigaction before {};
  if (sigaction(SIGHUP, nullptr, &before) == 0 && before.sa_handler != SIG_IGN) sigaction(SIGHUP, &action, nullptr);
}

void defer_interrupts() { g_deferred.store(true); }

bool interrupted() { return g_interrupted.load(std::memory_order_relaxed); }

}  // namespace octrad
