#include "octrad/scene/source.h"

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <memory>

#include "octrad/base/error.h"

namespace octrad {

SourceFile::SourceFile(std::string name, std::string text) : name_(std::move(name)), text_(std::move(text)) {
  line_starts_.push_back(0);
  for (std::size_t i = 0; i < text_.size(); ++i) {
    if (text_[i] == '\n') line_starts_.push_back(i + 1);
  }
}

std::string SourceFile::where(std::size_t offset) const {
  offset = std::min(offset, text_.size());
  const auto next = std::upper_bound(line_starts_.begin(), line_starts_.end(), offset);
  const auto line = static_cast<std::size_t>(next - line_starts_.begin());
  return name_ + ":" + std::to_string(line) + ":" + std::to_string(offset - *(next - 1) + 1);
}

void fail(const Location& location, const std::string& message) { throw InputError(location.text() + ": " + message); }

std::string read_file(const std::string& path) {
  std::error_code code;
  if (std::filesystem::is_directory(path, code)) throw IoError(path + ": is a folder, not a file");
  const std::unique_ptr<std::FILE, int (*)(std::FILE*)> file(std::fopen(path.c_str(), "rb"), &std::fclose);
  if (!file) throw IoError(path + ": cannot be opened: " + std::strerror(errno));
  std::string text;
  const auto size = std::filesystem::file_size(path, code);
  if (!code) text.resize(static_cast<std::size_t>(size));
  std::size_t read = text.empty() ? 0 : std::fread(text.data(), 1, text.size(), file.get());
  text.resize(read);
  // Pipes and files that grow have no size beforehand.
  char buffer[65536];
  while (!std::ferror(file.get()) && (read = std::fread(buffer, 1, sizeof buffer, file.get())) > 0)
    text.append(buffer, read);
  if (std::ferror(file.get())) throw IoError(path + ": cannot be read: " + std::strerror(errno));
  return text;
}

}  // namespace octrad
