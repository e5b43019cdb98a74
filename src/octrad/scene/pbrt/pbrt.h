// pbrt scenes of versions 3 and 4 -> the elements of a scene file, from which a Scene is built as from any other.
// Internal to the module.
#pragma once

#include <string>

#include "octrad/scene/description.h"

namespace octrad {

// Whether a file of this name is a scene of pbrt.
bool is_pbrt(const std::string& file);

// `text`: the content of `file`, whose folder is among the search paths of `description`. Meshes, curves and pictures
// that no file holds as they are needed go to description.built. Throws InputError with file:line:column, IoError,
// MemoryError; what cannot be used goes to `report`. What becomes of materials, lights and cameras is in
// docs/scenes.md.
void read_pbrt(const std::string& file, std::string text, Description& description, SceneReport& report);

}  // namespace octrad
