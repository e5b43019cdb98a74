// Scene files of Mitsuba 0.5 and 0.6, and of versions after 3.9, in the terms of Mitsuba 3.9. Internal to the module.
#pragma once

#include "octrad/scene/description.h"
#include "octrad/scene/report.h"

namespace octrad {

// Changes an element of a file whose version is below 2, whose children have been changed already:
//   - names of parameters from camelCase to snake_case, `diffuse_reflectance` of diffuse to `reflectance`, and
//     uoffset, voffset, uscale, vscale of textures to `to_uv`, as Mitsuba 3's own upgrade does (core/parser.cpp);
//   - tags and parameters that Mitsuba 3 has no longer to what they meant (manual of Mitsuba 0.6): <srgb>, <blackbody>,
//     spectra of three numbers, ldrfilm, gamma, trilinear ...;
//   - scattering models that Mitsuba 3 has not to the closest that it has.
// What changes more than names is noted in `report`, and what has no counterpart refused there, with the way out.
void upgrade_element(Element& element, SceneReport& report);

// Changes an element of another file: what Mitsuba 2 had and 3 has not, and filters of textures by mip maps, with what
// belongs to them in sensors, which Mitsuba has after 3.9. Noted in `report` where pictures may differ.
void downgrade_element(Element& element, SceneReport& report);

// "toWorld" -> "to_world", "intIOR" -> "int_ior".
std::string snake_case(const std::string& name);

}  // namespace octrad
