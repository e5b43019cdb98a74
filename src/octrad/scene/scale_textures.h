// Textures "scale" of Mitsuba 0.5 and 0.6, which multiply another texture by a constant. Mitsuba 3 has none. Internal
// to the module.
#pragma once

#include "octrad/scene/description.h"

namespace octrad {

// Makes each of them what it scales, with the factor in it: a bitmap of a picture that is built, a checkerboard, a
// mesh_attribute or a constant. Noted in the report. Those that cannot be folded so stay, and are refused where
// something uses them. Ids must be known.
void fold_scale_textures(Description& description);

}  // namespace octrad
