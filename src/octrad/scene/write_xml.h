// A scene file of any version that can be read, as a plain file of Mitsuba 3.
#pragma once

#include <string>

#include "octrad/scene/load.h"

namespace octrad {

// What was understood of `file` in the terms of Mitsuba 3: parameters and included files in their places, transforms as
// matrices, colours and spectra as linear RGB, the integrator as `path`; without what has no effect here. Names of
// files are relative to the folder of `output`, where the text is meant to go. With options.permissive, what cannot be
// used is replaced or left out as load_scene() does. `scene` is what was read. Throws as load_scene() does.
std::string scene_as_xml(const std::string& file, const std::string& output, const LoadOptions& options, Scene& scene);

}  // namespace octrad
