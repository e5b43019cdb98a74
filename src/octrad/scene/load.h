// Scene files (Mitsuba XML, glTF) -> Scene.
#pragma once

#include <map>
#include <string>

#include "octrad/scene/scene.h"

namespace octrad {

struct LoadOptions {
  std::map<std::string, std::string> definitions;  // -D name=value: overrides <default name=...>
  // What cannot be used is replaced by a visible stand-in (a magenta surface) or left out, and listed in
  // Scene::refused.
  bool permissive = false;
};

// Throws InputError ("file:line:column: what is wrong; what is supported") or IoError.
Scene load_scene(const std::string& file, const LoadOptions& options = {});

// Everything that load_scene() would refuse of a file and all that belongs to it, one mistake after the other, and what
// it has to assume. The scene loads where nothing is refused. Throws MemoryError, or IoError where `file` cannot be
// read.
struct SceneCheck {
  std::vector<SceneIssue> refused;
  std::vector<std::string> assumed;
  bool has_stand_ins = false;  // the file loads with LoadOptions::permissive
};
SceneCheck check_scene_file(const std::string& file, const LoadOptions& options = {});

}  // namespace octrad
