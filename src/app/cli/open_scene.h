// Loading a scene the way verbs do: its warnings are logged.
#pragma once

#include <functional>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

#include "octrad/base/error.h"
#include "octrad/scene/load.h"
#include "octrad/scene/scene.h"

namespace octrad::cli {

// A scene that cannot be used: its first mistake.
struct SceneRefused : Error {
  SceneRefused(const Error& mistake, const std::string& of, const LoadOptions& with, double after)
      : Error(mistake.code(), mistake.what()),
        file(of),
        options(with),
        seconds(after) {}
  std::string file;
  LoadOptions options;
  double seconds;  // of reading it, up to there
};
// How many mistakes there are, and how to go on: a line each; none where nothing helps. Reads the file once more where
// that is quick.
std::string way_out(const SceneRefused& refused);

// Runs `read`, which reads that file. Throws SceneRefused where it cannot be used.
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
