// Loading a scene the way verbs do: its warnings are logged.
#pragma once

#include <map>
#include <string>

#include "octrad/scene/scene.h"

namespace octrad::cli {

// `definitions`: values of the scene file's parameters. Throws as load_scene() does.
Scene open_scene(const std::string& file, const std::map<std::string, std::string>& definitions);

}  // namespace octrad::cli
