// Films on a device against the CPU's.
#pragma once

#include "octrad/device/check.h"

namespace octrad {

// Random samples of a picture of width x height pixels, handed over in strips of rows, on a film of a window in it;
// with every filter. Some samples are not finite.
CheckResult check_film(Stream& stream, int width, int height, int strip, std::uint64_t seed);

}  // namespace octrad
