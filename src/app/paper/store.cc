#include "app/paper/store.h"

#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <filesystem>

#include "app/paper/child.h"
#include "octrad/base/atomic_file.h"
#include "octrad/base/error.h"
#include "octrad/base/escape.h"
#include "octrad/base/input_file.h"
#include "octrad/base/json_file.h"

namespace octrad::paper {
namespace fs = std::filesystem;

Store::Store(std::string folder) : folder_(std::move(folder)) {
  while (folder_.size() > 1 && folder_.back() == '/') folder_.pop_back();
}

namespace {

std::pair<std::uint64_t, std::uint64_t> identity_of(const std::string& folder) {
  struct stat info {};
  if (stat(folder.c_str(), &info) != 0) return {};
  return {static_cast<std::uint64_t>(info.st_dev), static_cast<std::uint64_t>(info.st_ino)};
}

}  // namespace

void Store::open() {
  make_folder("");
  // Both files are written anew: in a folder of something else they are not ours.
  if (has("results.json") ? !read("results.json").contains("program") : has("index.html") && !has("rates"))
    throw InputError(fmt::format("{} holds {} of something else, which a report would replace; take another folder",
                                 folder_, has("results.json") ? "a results.json" : "an index.html"));
  require_writable(path("results.json"));
  identity_ = identity_of(folder_);
}

void Store::require_there() const {
  if (identity_of(folder_) != identity_)
    throw IoError(
        fmt::format("{} was removed or replaced while octrad worked in it; the same command begins anew", folder_));
}

bool Store::has(const std::string& name) const { return fs::exists(path(name)); }

void Store::make_folder(const std::string& name) const {
  if (!name.empty()) require_there();
  const std::string folder = name.empty() ? folder_ : path(name);
  std::error_code error;
  fs::create_directories(folder, error);
  if (error || !fs::is_directory(folder))
    throw IoError(
        fmt::format("cannot make folder {}: {}", folder, error ? error.message() : "there is a file of that name"));
}

void Store::link(const std::string& name, const std::string& target) const {
  std::error_code error;
  const fs::path link = path(name);
  if (fs::is_symlink(link, error) && fs::read_symlink(link, error) == target) return;
  if (fs::is_symlink(link, error) && !fs::exists(link, error)) fs::remove(link, error);  // where it led to is gone
  fs::create_symlink(target, link, error);
  if (!error || (fs::is_symlink(link) && fs::read_symlink(link) == target)) return;
  if (fs::exists(link))
    throw InputError(
        fmt::format("{} is there already and is not {}; take another folder for this run, or rename the scene",
                    link.string(), target));
  throw IoError(fmt::format("cannot make {}: {}", link.string(), error.message()));
}

std::string Store::read_text(const std::string& name) const { return read_file(path(name)); }

nlohmann::json Store::read(const std::string& name) const {
  if (!has(name)) return nullptr;
  const nlohmann::json value = parse_json_or_discard(read_text(name));
  return value.is_discarded() ? nlohmann::json() : value;
}

void Store::write(const std::string& name, const nlohmann::json& value) const {
  write_text(name, json_text(value, 1) + "\n");
}

void Store::write_text(const std::string& name, const std::string& text) const {
  require_there();
  write_file(path(name), text);
}

void Store::remove(const std::string& name) const {
  std::error_code ignored;
  fs::remove_all(path(name), ignored);
}

nlohmann::json Store::ask(const std::vector<std::string>& words, const std::string& log) const {
  std::vector<std::string> all = words;
  all.insert(all.end(), common.begin(), common.end());
  all.insert(all.end(), {"--json", "-q"});
  const ChildResult result = run_octrad(all, folder_, log.empty() ? "/dev/null" : path(log), waiting);
  const std::string line = "octrad " + shell_text(all);
  if (result.exit_code == 130) throw Interrupted{};
  if (!result.ok()) {
    require_there();
    // A disk that is full, or a folder that cannot be written: every other command would end the same way.
    if (result.exit_code == 3 && result.message.rfind("cannot write", 0) == 0) throw IoError(result.message);
    throw CommandFailed{result.exit_code, result.message, line};
  }
  const nlohmann::json output = parse_json_or_discard(result.out);
  if (output.is_discarded()) throw CommandFailed{70, "printed no JSON", line};
  return {{"command", line}, {"seconds", result.seconds}, {"peak_bytes", result.peak_bytes}, {"output", output}};
}

nlohmann::json Store::command(const std::string& record, const std::vector<std::string>& words) const {
  nlohmann::json kept = read(record);
  if (kept.is_object() && kept.contains("output")) return kept;
  kept = ask(words, (fs::path(record).parent_path() / "log.txt").string());
  write(record, kept);
  return kept;
}

}  // namespace octrad::paper
