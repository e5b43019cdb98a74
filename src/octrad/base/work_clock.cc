#include "octrad/base/work_clock.h"

#include <system_error>

namespace octrad {
namespace {
constexpr double kStopped = 1.0;  // seconds between two looks
}

WorkClock::WorkClock() {
  try {
    looker_ = std::thread([this] {
      std::unique_lock lock(mutex_);
      while (!ending_.wait_for(lock, std::chrono::milliseconds(100), [&] { return ended_; })) look();
    });
  } catch (const std::system_error&) {  // a limit of the user or of the container
    const std::lock_guard lock(mutex_);
    alone_ = true;
  }
}

WorkClock::~WorkClock() {
  {
    const std::lock_guard lock(mutex_);
    ended_ = true;
  }
  ending_.notify_one();
  if (looker_.joinable()) looker_.join();
}

void WorkClock::look() {
  const Clock::time_point now = Clock::now();
  const double passed = std::chrono::duration<double>(now - last_).count();
  last_ = now;
  if (passed < kStopped || alone_) counted_ += passed;
}

double WorkClock::seconds() {
  const std::lock_guard lock(mutex_);
  look();
  return counted_;
}

void WorkClock::back_to(double then) {
  const std::lock_guard lock(mutex_);
  look();
  counted_ = then;
}

}  // namespace octrad
