// How large pictures may be.
#pragma once

namespace octrad {

// Pixels along a side of a picture or of a film.
inline constexpr int kMostFilmPixels = 131072;

}  // namespace octrad
