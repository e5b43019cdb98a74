#include "octrad/scene/report.h"

namespace octrad {

void SceneReport::refuse(const Location& where, const std::string& what) {
  if (!collect_) fail(where, what);
  list(where.text(), what);
}

void SceneReport::collect(const Location& where, const Error& error) {
  if (error.code() != ExitCode::bad_input && error.code() != ExitCode::io) throw;
  if (const auto* mistake = dynamic_cast<const SceneError*>(&error)) list(mistake->where, mistake->message);
  else list(where.text(), error.what());
}

// The same mistake at the same place counts once: many objects may meet it.
void SceneReport::list(const std::string& where, const std::string& what) {
  if (refused_.size() < kMostIssues && listed_.emplace(where, what).second) refused_.push_back({where, what});
}

void SceneReport::assume(const Location& where, const std::string& what) {
  auto at = index_.find(what);
  if (at == index_.end()) {
    if (assumed_.size() >= kMostIssues) return;
    at = index_.emplace(what, assumed_.size()).first;
    assumed_.push_back({what, where, 0});
  }
  ++assumed_[at->second].count;
}

std::vector<std::string> SceneReport::assumed() const {
  std::vector<std::string> texts;
  for (const Assumption& a : assumed_) {
    texts.push_back(a.what + " (" + (a.first.file ? a.first.text() : "") +
                    (a.count > 1 ? ", " + std::to_string(a.count) + " times)" : ")"));
  }
  return texts;
}

}  // namespace octrad
