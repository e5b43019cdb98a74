#include "app/paper/jobs.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <memory>
#include <thread>
#include <utility>

#include "octrad/base/atomic_file.h"
#include "octrad/base/duration.h"
#include "octrad/base/error.h"
#include "octrad/base/interrupt.h"
#include "octrad/base/log.h"
#include "octrad/base/progress.h"
#include "octrad/base/stopwatch.h"

namespace octrad::paper {

std::size_t Jobs::add(Job job) {
  const auto [at, is_new] = number_of_.emplace(job.result, jobs_.size());
  if (is_new) jobs_.push_back(std::move(job));
  return at->second;
}

Jobs::Left Jobs::left() const {
  Left left;
  for (const Job& job : jobs_) {
    if (store_.has(job.result)) continue;
    ++left.jobs;
    left.seconds += job.cost;
  }
  return left;
}

// Ends the job, and with it all that need it.
void Jobs::fail(Job& job, const nlohmann::json& why) {
  job.state = Job::State::failed;
  store_.make_folder(job.folder);
  store_.write(job.result + ".failed", why);
  const auto number = static_cast<std::size_t>(&job - jobs_.data());
  for (Job& other : jobs_)
    if (other.state == Job::State::waiting && std::count(other.needs.begin(), other.needs.end(), number))
      fail(other, why);
}

void Jobs::fail(Job& job, const std::string& message, const std::string& command, bool unavailable) {
  fail(job, {{"message", message}, {"command", command}, {"unavailable", unavailable}});
  if (unavailable) log_info("{}: not available: {}", job.title, message);
  else log_warning(fmt::format("{} failed: {}", job.title, message));
}

// False when another process is at it.
bool Jobs::do_job(Job& job) {
  store_.make_folder(job.folder);
  const std::unique_ptr<WriterLock> lock = WriterLock::try_to_take(store_.path(job.result));
  if (!lock) return false;
  if (store_.has(job.result)) {  // made by another process in the meantime
    job.state = Job::State::done;
    return true;
  }
  try {
    job.work();
    store_.remove(job.result + ".failed");
    job.state = Job::State::done;
  } catch (const CommandFailed& failure) {
    fail(job, failure.message, failure.command, job.library && failure.exit_code == 3);
  } catch (const InputError& error) {
    fail(job, error.what(), "", false);
  } catch (const MemoryError& error) {
    fail(job, error.what(), "", false);
  } catch (const nlohmann::json::exception& error) {
    fail(job, std::string("what a command printed is not as expected: ") + error.what(), "", false);
  } catch (const Interrupted&) {
    if (!interrupted()) fail(job, "its command was interrupted", "", false);
  }
  return true;
}

bool Jobs::run(const std::function<void()>& after_each) {
  defer_interrupts();  // commands save what they have, and this process keeps their records
  Progress progress("paper");
  double estimated = 0.0, spent = 0.0;  // `spent` on jobs that were estimated to take `estimated`
  for (Job& job : jobs_)
    if (store_.has(job.result)) job.state = Job::State::done;
  const auto seconds_left = [&] {
    double sum = 0.0;
    for (const Job& job : jobs_) sum += job.state == Job::State::waiting ? job.cost : 0.0;
    return sum;
  };
  const double total = seconds_left();
  while (!interrupted()) {
    bool moved = false, waits = false;
    for (Job& job : jobs_) {
      if (interrupted()) break;
      if (job.state != Job::State::waiting) continue;
      if (store_.has(job.result)) {
        job.state = Job::State::done;
        moved = true;
        continue;
      }
      if (std::any_of(job.needs.begin(), job.needs.end(),
                      [&](std::size_t n) { return jobs_[n].state != Job::State::done; })) {
        waits = true;
        continue;
      }
      // Times so far correct the estimates of what is left.
      const double slower = estimated > 5.0 ? std::clamp(spent / estimated, 0.2, 20.0) : 1.0;
      const double left = seconds_left();
      const Stopwatch watch;  // of all commands of the job
      store_.waiting = [&] {
        if (!progress.due()) return;
        const double rest = std::max(0.0, left - std::min(job.cost, watch.seconds() / slower));
        progress.update(total > 0.0 ? std::clamp(1.0 - rest / total, 0.0, 1.0) : 0.0, job.title, false, rest * slower);
      };
      if (!do_job(job)) {
        waits = true;
        continue;
      }
      moved = true;
      if (job.state == Job::State::done) {
        spent += watch.seconds();
        estimated += job.cost;
        log_verbose("{}: {}", job.title, format_duration(watch.seconds()));
      }
      after_each();
    }
    if (!waits) break;
    if (!moved) std::this_thread::sleep_for(std::chrono::milliseconds(500));  // another process has the rest
  }
  progress.finish();
  store_.waiting = [] {};
  return !interrupted();
}

}  // namespace octrad::paper
