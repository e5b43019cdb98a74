#include "app/cli/open_scene.h"

#include <fmt/format.h>

#include "app/cli/common.h"
#include "octrad/base/bytes.h"
#include "octrad/base/duration.h"
#include "octrad/base/error.h"
#include "octrad/base/join.h"
#include "octrad/base/log.h"
#include "octrad/base/stopwatch.h"
#include "octrad/scene/load.h"
#include "octrad/scene/source.h"

namespace octrad::cli {

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

namespace {

// What can be done about a scene that is refused: text to be put behind the first mistake.
std::string way_out(const std::string& file, const LoadOptions& options) {
  try {
    const SceneCheck check = check_scene_file(file, options);
    std::string text;
    if (check.refused.size() > 1)
      text = fmt::format("\nIt is one of {} mistakes: octrad info {} --check lists them.", check.refused.size(), file);
    if (check.has_stand_ins) text += "\n--permissive takes stand-ins for what cannot be used.";
    return text;
  } catch (const Error&) {
    return "";
  }
}

}  // namespace

void read_scene(const std::string& file, const LoadOptions& options, const std::function<void()>& read) {
  try {
    read();
  } catch (const SceneError& error) {
    if (options.permissive) throw;
    throw InputError(error.what() + way_out(file, options));
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
