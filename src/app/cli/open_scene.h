// Loading a scene the way verbs do: its warnings are logged.
#pragma once

#include <map>
#include <string>
#include <utility>
#include <vector>

#include "octrad/scene/scene.h"

namespace octrad::cli {

// `definitions`: values of the scene file's parameters. `outputs`: options and the files that they name, which must not
// be what the scene refers to. Throws as load_scene() does, and UsageError.
Scene open_scene(const std::string& file, const std::map<std::string, std::string>& definitions,
                 const std::vector<std::pair<std::string, std::string>>& outputs = {});

}  // namespace octrad::cli
