// Elapsed time without that in which the process was stopped: Ctrl-Z, SIGSTOP, a batch system that suspends jobs.
#pragma once

#include <chrono>
#include <condition_variable>
#include <mutex>
#include <thread>

namespace octrad {

// A thread looks at the clock ten times a second. When more than a second passes between two looks, nothing ran, and
// that time is not counted. Where no thread can be started, all time is.
class WorkClock {
 public:
  WorkClock();
  ~WorkClock();
  WorkClock(const WorkClock&) = delete;
  WorkClock& operator=(const WorkClock&) = delete;

  double seconds();
  // Takes back what was counted since it said `then`.
  void back_to(double then);

 private:
  using Clock = std::chrono::steady_clock;
  void look();  // with mutex_ held

  std::mutex mutex_;
  std::condition_variable ending_;
  bool ended_ = false, alone_ = false;  // alone: no thread looks
  Clock::time_point last_ = Clock::now();
  double counted_ = 0.0;
  std::thread looker_;
};

}  // namespace octrad
