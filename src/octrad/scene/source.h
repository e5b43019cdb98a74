// Locations in an input file (line, column), and errors that name them.
#pragma once

#include <cstddef>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "octrad/base/error.h"

namespace octrad {

// A text file in memory, with line and column of a byte offset. One without text has no lines, only its name, which may
// be any place.
class SourceFile {
 public:
  SourceFile(std::string name, std::string text);
  const std::string& name() const { return name_; }
  const std::string& text() const { return text_; }
  // "name:line:column", both counted from 1; columns count bytes. Without text: "name".
  std::string where(std::size_t offset) const;

 private:
  std::string name_, text_;
  std::vector<std::size_t> line_starts_;
};

// A place in a source file. Default constructed: nowhere.
struct Location {
  std::shared_ptr<const SourceFile> file;
  std::size_t offset = 0;
  std::string text() const { return file ? file->where(offset) : std::string("scene"); }
};

// A mistake in a scene file or in one that it refers to, with its place.
struct SceneError : InputError {
  SceneError(std::string place, std::string mistake);
  std::string where, message;  // "file:line:column", and what is wrong; what() is both
};

// Throws SceneError.
[[noreturn]] void fail(const Location& location, const std::string& message);
// The same of a text that is in memory, without a copy of it.
[[noreturn]] void fail(const std::string& name, std::string_view text, std::size_t offset, const std::string& message);

}  // namespace octrad
