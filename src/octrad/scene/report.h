// What reading a scene file finds out besides the scene: what had to be assumed, and what is refused.
#pragma once

#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "octrad/scene/source.h"

namespace octrad {

// Mistakes, assumptions and warnings that are kept of each kind: more say nothing new, and a file can hold millions.
inline constexpr std::size_t kMostIssues = 1000;

// Something in a scene file that cannot be used.
struct SceneIssue {
  std::string where;  // "file:line:column"
  std::string what;
};

class SceneReport {
 public:
  // `collect`: mistakes are listed and reading goes on with a stand-in; without, the first one is thrown.
  explicit SceneReport(bool collect) : collect_(collect) {}

  bool collects() const { return collect_; }
  // Lists a mistake, or throws it.
  void refuse(const Location& where, const std::string& what);
  // Something that the file leaves open, or means otherwise than this reader; the same text counts once.
  void assume(const Location& where, const std::string& what);

  // Runs `work`. Where that fails and mistakes are collected, lists the mistake and returns false. Errors that name no
  // place are listed at `where`. Memory that runs out is never collected.
  template <typename Work>
  bool attempt(const Location& where, Work&& work) {
    if (!collect_) {
      work();
      return true;
    }
    try {
      work();
      return true;
    } catch (const Error& error) {
      collect(where, error);
    }
    return false;
  }
  // Lists the mistake `error`; throws it again where it is none of the scene's.
  void collect(const Location& where, const Error& error);

  const std::vector<SceneIssue>& refused() const { return refused_; }
  // One text each, with the place where it was first assumed and how often.
  std::vector<std::string> assumed() const;

 private:
  void list(const std::string& where, const std::string& what);

  struct Assumption {
    std::string what;
    Location first;
    int count = 0;
  };
  bool collect_;
  std::vector<SceneIssue> refused_;
  std::set<std::pair<std::string, std::string>> listed_;
  std::vector<Assumption> assumed_;
  std::map<std::string, std::size_t> index_;  // of assumed_, by text
};

}  // namespace octrad
