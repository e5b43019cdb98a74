// Mitsuba 3 XML -> Scene.
#pragma once

#include <map>
#include <string>

#include "octrad/scene/scene.h"

namespace octrad {

struct LoadOptions {
  std::map<std::string, std::string> definitions;  // -D name=value: overrides <default name=...>
};

// Throws InputError ("file:line:column: what is wrong; what is supported") or IoError.
Scene load_scene(const std::string& file, const LoadOptions& options = {});

}  // namespace octrad
