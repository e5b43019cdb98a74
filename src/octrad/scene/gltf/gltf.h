// glTF 2.0 -> the elements of a scene file, from which a Scene is built as from any other. Internal to the module.
#pragma once

#include <string>

#include "octrad/scene/description.h"

namespace octrad {

// Whether a file of this name and content is glTF: JSON or the binary container.
bool is_gltf(const std::string& file, const std::string& bytes);

// `bytes`: the content of `file`, whose folder is among the search paths of `description`. Meshes and pictures go to
// description.built. Throws InputError that names the object in the file, IoError, MemoryError; extensions and other
// things that cannot be used go to `report`. What becomes of materials, lights and cameras is in docs/scenes.md.
void read_gltf(const std::string& file, std::string bytes, Description& description, SceneReport& report);

}  // namespace octrad
