#include "octrad/base/work_clock.h"

#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include "octrad/base/stopwatch.h"

namespace octrad {
namespace {

TEST(WorkClock, CountsWhileTheProcessRuns) {
  const Stopwatch watch;
  WorkClock clock;
  double last = 0.0;
  while (watch.seconds() < 0.35) {
    const double now = clock.seconds();
    EXPECT_GE(now, last);
    last = now;
    usleep(1000);
  }
  EXPECT_NEAR(clock.seconds(), watch.seconds(), 0.05);
}

TEST(WorkClock, TakesTimeBack) {
  WorkClock clock;
  const double before = clock.seconds();
  usleep(200000);
  clock.back_to(before);
  EXPECT_LT(clock.seconds(), before + 0.1);
}

TEST(WorkClock, DoesNotCountWhileTheProcessIsStopped) {
  int says[2];
  ASSERT_EQ(pipe(says), 0);
  const pid_t child = fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    const Stopwatch watch;
    WorkClock clock;
    if (write(says[1], "x", 1) != 1) _exit(1);
    while (watch.seconds() < 1.9) usleep(10000);
    const double counted = clock.seconds();
    _exit(counted < 0.9 && counted > 0.05 ? 0 : 2);
  }
  char ready;
  ASSERT_EQ(read(says[0], &ready, 1), 1);
  usleep(200000);
  kill(child, SIGSTOP);
  usleep(1400000);
  kill(child, SIGCONT);
  int status = 0;
  ASSERT_EQ(waitpid(child, &status, 0), child);
  EXPECT_TRUE(WIFEXITED(status));
  EXPECT_EQ(WEXITSTATUS(status), 0);
  close(says[0]);
  close(says[1]);
}

}  // namespace
}  // namespace octrad
