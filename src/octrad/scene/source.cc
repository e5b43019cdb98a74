#include "octrad/scene/source.h"

#include <algorithm>

namespace octrad {

SourceFile::SourceFile(std::string name, std::string text) : name_(std::move(name)), text_(std::move(text)) {
  line_starts_.push_back(0);
  for (std::size_t i = 0; i < text_.size(); ++i) {
    if (text_[i] == '\n') line_starts_.push_back(i + 1);
  }
}

std::string SourceFile::where(std::size_t offset) const {
  if (text_.empty()) return name_;
  offset = std::min(offset, text_.size());
  const auto next = std::upper_bound(line_starts_.begin(), line_starts_.end(), offset);
  const auto line = static_cast<std::size_t>(next - line_starts_.begin());
  return name_ + ":" + std::to_string(line) + ":" + std::to_string(offset - *(next - 1) + 1);
}

SceneError::SceneError(std::string place, std::string mistake)
    : InputError(place + ": " + mistake),
      where(std::move(place)),
      message(std::move(mistake)) {}

void fail(const Location& location, const std::string& message) { throw SceneError(location.text(), message); }

void fail(const std::string& name, std::string_view text, std::size_t offset, const std::string& message) {
  const std::string_view before = text.substr(0, offset);
  const auto line = std::count(before.begin(), before.end(), '\n') + 1;
  const std::size_t start = before.rfind('\n');
  const std::size_t column = start == std::string_view::npos ? offset + 1 : offset - start;
  throw SceneError(name + ":" + std::to_string(line) + ":" + std::to_string(column), message);
}

}  // namespace octrad
