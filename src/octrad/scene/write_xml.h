// A scene file of any version that can be read, as a plain file of Mitsuba 3.
#pragma once

#include <functional>
#include <map>
#include <string>

#include "octrad/scene/load.h"

namespace octrad {

// The text of a scene file, and the meshes and pictures that it refers to and that no file holds: by the paths that the
// text has for them, relative to its folder, functions that give the bytes of such a file (and throw IoError or
// InputError).
struct SceneFiles {
  std::string xml;
  std::map<std::string, std::function<std::string()>> others;
};

// What was understood of `file` in the terms of Mitsuba 3: parameters and included files in their places, transforms as
// matrices, colours and spectra as linear RGB, the integrator as `path`; without what has no effect here. Names of
// files are relative to the folder of `output`, where the text is meant to go. What a glTF file holds inside goes to
// files in a folder beside it, NAME-files. With options.permissive, what cannot be used is replaced or left out as
// load_scene() does. `scene` is what was read. Throws as load_scene() does.
SceneFiles scene_as_xml(const std::string& file, const std::string& output, const LoadOptions& options, Scene& scene);

}  // namespace octrad
