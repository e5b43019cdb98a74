// Pieces of work of which some need others, done one after the other by all processes that share a run's folder.
#pragma once

#include <functional>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "app/paper/store.h"

namespace octrad::paper {

// A piece of work with a folder of its own. It is done when its result is there, whoever made it.
struct Job {
  std::string title, folder, result;
  double cost = 0.0;  // estimated seconds
  std::vector<std::size_t> needs;
  std::function<void()> work;
  bool library = false;  // needs one that may not be there
  enum class State { waiting, done, failed } state = State::waiting;
};

class Jobs {
 public:
  explicit Jobs(Store& store) : store_(store) {}

  // The number of the job, or of the one with its result that there is already.
  std::size_t add(Job job);
  std::size_t size() const { return jobs_.size(); }
  struct Left {
    std::size_t jobs = 0;
    double seconds = 0.0;  // estimated
  };
  Left left() const;  // without results yet

  // Does what is left, in the order in which it was added and as what it needs is done, and calls after_each() after
  // each. A job that fails ends those that need it, and no other; "RESULT.failed" says why. False when interrupted.
  bool run(const std::function<void()>& after_each);

 private:
  bool do_job(Job& job);
  void fail(Job& job, const nlohmann::json& why);
  void fail(Job& job, const std::string& message, const std::string& command, bool unavailable);

  Store& store_;
  std::vector<Job> jobs_;
  std::map<std::string, std::size_t> number_of_;  // by result
};

}  // namespace octrad::paper
