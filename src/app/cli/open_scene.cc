#include "app/cli/open_scene.h"

#include <fmt/format.h>

#include "app/cli/common.h"
#include "octrad/base/bytes.h"
#include "octrad/base/duration.h"
#include "octrad/base/escape.h"
#include "octrad/base/join.h"
#include "octrad/base/log.h"
#include "octrad/base/stopwatch.h"
#include "octrad/scene/report.h"

namespace octrad::cli {
namespace {

constexpr double kQuick = 0.5;  // seconds of reading a scene, which are spent once more on a hint

}  // namespace

nlohmann::json issues_json(const std::vector<SceneIssue>& issues) {
  nlohmann::json list = nlohmann::json::array();
  for (const SceneIssue& issue : issues) list.push_back({{"where", issue.where}, {"what", issue.what}});
  return list;
}

void log_findings(const Scene& scene) {
  for (const std::string& warning : scene.warnings) log_warning(warning);
  if (!scene.assumed.empty()) log_warning("assumed: " + join(scene.assumed, "; "));
  for (const SceneIssue& issue : scene.refused) log_warning(issue.where + ": not used: " + issue.what);
}

std::string way_out(const SceneRefused& refused) {
  if (refused.options.permissive) return "";
  std::vector<std::string> words = {"octrad", "info", refused.file, "--check"};
  for (const auto& [name, value] : refused.options.definitions) words.insert(words.end(), {"-D", name + "=" + value});
  const std::string list = shell_text(words);
  if (refused.seconds > kQuick) return list + " lists all that stands in the way.\n";
  try {
    const SceneCheck check = check_scene_file(refused.file, refused.options);
    const std::size_t count = check.refused.size();
    std::string text;
    if (count > 1) {
      text = fmt::format("It is one of {} mistakes{}: {} lists them.\n", count, count < kMostIssues ? "" : " or more",
                         list);
    }
    if (check.has_stand_ins && count > 0) text += "--permissive takes stand-ins for what cannot be used.\n";
    return text;
  } catch (const std::exception&) {  // out of memory, say: what was wrong in the first place has been said
    return "";
  }
}

void read_scene(const std::string& file, const LoadOptions& options, const std::function<void()>& read) {
  const Stopwatch watch;
  try {
    read();
  } catch (const Error& error) {
    if (error.code() != ExitCode::bad_input && error.code() != ExitCode::io) throw;
    throw SceneRefused(error, file, options, watch.seconds());
  }
}

Scene open_scene(const std::string& file, const std::map<std::string, std::string>& definitions, bool permissive,
                 const std::vector<std::pair<std::string, std::string>>& outputs) {
  const Stopwatch watch;
  LoadOptions options;
  options.definitions = definitions;
  options.permissive = permissive;
  Scene scene;
  read_scene(file, options, [&] { scene = load_scene(file, options); });
  for (const auto& [option, output] : outputs) refuse_input_as_output(option, output, scene.other_files);
  log_findings(scene);
  log_verbose("{}: {} triangles in {} shapes, parsed in {}", file,
              format_count(static_cast<long long>(scene.triangle_count())), scene.shapes.size(),
              format_duration(watch.seconds()));
  return scene;
}

}  // namespace octrad::cli
