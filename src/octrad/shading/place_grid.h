// Boxes for the places of shading/place_grid_math.h.
#pragma once

#include <span>

#include "octrad/shading/place_grid_math.h"

namespace octrad {

// Bounds of all but a few of the positions, of which there is one at least; some are left out at each end of each axis.
Bounds3f bounds_of_most(std::span<const Vec3f> positions);

}  // namespace octrad
