// What the pixel inspector says.
#pragma once

#include <nlohmann/json.hpp>

#include "app/view/side_renderer.h"

namespace octrad::viewer {

// The surface that the ray through (x, y) of the picture's width and height, each in [0, 1], meets: place, material,
// normal, roughness; with a model, what it is asked there, and its answers, as octrad query gives them. A point that is
// not on a surface has "hit": false. Thread-safe.
nlohmann::json inspect(const Studio& studio, const View& view, double x, double y, const ViewerModel* model);

}  // namespace octrad::viewer
