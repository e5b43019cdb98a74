#include "octrad/base/work_clock.h"

#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include "octrad/base/stopwatch.h"

namespace octrad {
namespace {

constexpr double kRounding = 1e-9;  // of sums of what passes between two looks

TEST(WorkClock, CountsWhileTheProcessRuns) {
  const Stopwatch longer;
  WorkClock clock;
  const Stopwatch shorter;
  double last = 0.0, before = 0.0, lost = 0.0;
  while (shorter.seconds() < 0.35) {
    const double least = shorter.seconds(), now = clock.seconds(), most = longer.seconds();
    if (most - before > 0.9) lost += most - before;  // nothing ran: a machine that does so to all looks like a stop
    EXPECT_GE(now, last);
    EXPECT_GE(now + lost, least - kRounding);
    EXPECT_LE(now, most + kRounding);
    last = now;
    before = most;
    usleep(1000);
  }
}

TEST(WorkClock, TakesTimeBack) {
  WorkClock clock;
  const double before = clock.seconds();
  usleep(200000);
  const Stopwatch since;
  clock.back_to(before);
  const double now = clock.seconds();
  EXPECT_GE(now, before);
  EXPECT_LE(now, before + since.seconds() + kRounding);
}

TEST(WorkClock, DoesNotCountWhileTheProcessIsStopped) {
  int says[2], hears[2];
  ASSERT_EQ(pipe(says), 0);
  ASSERT_EQ(pipe(hears), 0);
  const pid_t child = fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    close(hears[1]);
    const Stopwatch watch;
    WorkClock clock;
    usleep(10000);
    if (!(clock.seconds() > 0.0)) _exit(3);  // what is counted from here to the stop may be lost with it
    char over;
    if (write(says[1], "x", 1) != 1 || read(hears[0], &over, 1) != 1) _exit(1);
    const double counted = clock.seconds(), passed[2] = {counted, watch.seconds()};
    _exit(write(says[1], passed, sizeof passed) == sizeof passed ? 0 : 2);
  }
  close(says[1]);
  char ready;
  ASSERT_EQ(read(says[0], &ready, 1), 1);
  usleep(100000);
  kill(child, SIGSTOP);
  int status = 0;
  ASSERT_EQ(waitpid(child, &status, WUNTRACED), child);
  ASSERT_TRUE(WIFSTOPPED(status));
  const Stopwatch watch;
  usleep(1100000);
  const double stopped = watch.seconds();
  kill(child, SIGCONT);
  ASSERT_EQ(write(hears[1], "x", 1), 1);
  double passed[2] = {};
  ASSERT_EQ(read(says[0], passed, sizeof passed), static_cast<ssize_t>(sizeof passed));
  EXPECT_GT(passed[0], 0.0);
  EXPECT_LE(passed[0], passed[1] - stopped + kRounding);
  ASSERT_EQ(waitpid(child, &status, 0), child);
  EXPECT_TRUE(WIFEXITED(status));
  EXPECT_EQ(WEXITSTATUS(status), 0);
  for (const int descriptor : {says[0], hears[0], hears[1]}) close(descriptor);
}

}  // namespace
}  // namespace octrad
