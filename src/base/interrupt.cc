#include "base/interrupt.h"

#include <signal.h>
#include <unistd.h>

#include <atomic>

namespace octrad {
namespace {
std::atomic<int> g_signal{0};
static_assert(std::atomic<int>::is_always_lock_free, "used in a signal handler");

void on_signal(int signal) {
  if (g_signal.exchange(signal) != 0) {
    constexpr char kMessage[] = "\noctrad: stopped at once by a second signal; nothing more was saved\n";
    const ssize_t ignored = write(STDERR_FILENO, kMessage, sizeof(kMessage) - 1);
    static_cast<void>(ignored);
    _exit(130);
  }
}
}  // namespace

void install_interrupt_handler() {
  struct sigaction action{};
  action.sa_handler = on_signal;
  sigemptyset(&action.sa_mask);
  action.sa_flags = SA_RESTART;
  sigaction(SIGINT, &action, nullptr);
  sigaction(SIGTERM, &action, nullptr);
}

bool interrupted() { return g_signal.load(std::memory_order_relaxed) != 0; }
int interrupt_signal() { return g_signal.load(std::memory_order_relaxed); }
void set_interrupted(int signal) { g_signal.store(signal); }

}  // namespace octrad
