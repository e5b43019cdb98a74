// Loading a scene the way verbs do: its warnings are logged.
#pragma once

#include <functional>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

#include "octrad/scene/load.h"
#include "octrad/scene/scene.h"

namespace octrad::cli {

// Runs `read`, which reads that file. Where it refuses the scene, the error also says whether more stands in the way,
// and how to go on.
void read_scene(const std::string& file, const LoadOptions& options, const std::function<void()>& read);
// `definitions`: values of the scene file's parameters. `permissive`: LoadOptions. `outputs`: options and the files
// that they name, which must not be what the scene refers to. Throws as load_scene() does, and UsageError.
Scene open_scene(const std::string& file, const std::map<std::string, std::string>& definitions, bool permissive,
                 const std::vector<std::pair<std::string, std::string>>& outputs = {});
// Logs its warnings, one of all that was assumed, and what stand-ins were taken for.
void log_findings(const Scene& scene);
// [{"where": "file:line:column", "what": "..."}]
nlohmann::json issues_json(const std::vector<SceneIssue>& issues);

}  // namespace octrad::cli
