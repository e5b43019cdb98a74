#include <fcntl.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include "octrad/base/interrupt.h"

namespace octrad {
namespace {

// The exit code of a process that gets `count` signals and would end with 7 by itself, or 8 when interrupted().
int exit_code_after_signals(int count, bool defer, int which = SIGINT) {
  const pid_t child = fork();
  if (child == 0) {
    const int null = open("/dev/null", O_WRONLY);
    dup2(null, STDERR_FILENO);
    install_interrupt_handler();
    if (defer) defer_interrupts();
    for (int i = 0; i < count; ++i) raise(which);
    _exit(interrupted() ? 8 : 7);
  }
  int status = 0;
  if (waitpid(child, &status, 0) != child || !WIFEXITED(status)) return -1;
  return WEXITSTATUS(status);
}

TEST(Interrupt, FirstSignalEndsWith130WhileThereIsNothingToSave) { EXPECT_EQ(exit_code_after_signals(1, false), 130); }

TEST(Interrupt, DeferredSignalSetsAFlag) {
  EXPECT_EQ(exit_code_after_signals(0, true), 7);
  EXPECT_EQ(exit_code_after_signals(1, true), 8);
}

TEST(Interrupt, SecondSignalEndsWith130) { EXPECT_EQ(exit_code_after_signals(2, true), 130); }

// A terminal that is closed sends several.
TEST(Interrupt, HangUpSavesAndNeverEndsAtOnce) {
  const auto before = signal(SIGHUP, SIG_DFL);  // the tests may run under nohup
  EXPECT_EQ(exit_code_after_signals(1, false, SIGHUP), 130);
  EXPECT_EQ(exit_code_after_signals(3, true, SIGHUP), 8);
  signal(SIGHUP, before);
}

TEST(Interrupt, HangUpStaysIgnored) {
  const auto before = signal(SIGHUP, SIG_IGN);  // nohup
  EXPECT_EQ(exit_code_after_signals(1, false, SIGHUP), 7);
  signal(SIGHUP, before);
}

}  // namespace
}  // namespace octrad
