// Three numbers as a list, as JSON files and messages have them.
#pragma once

#include <nlohmann/json.hpp>

#include "octrad/base/vec.h"

namespace octrad {

inline nlohmann::json vector_json(Vec3f v) { return nlohmann::json::array({v.x, v.y, v.z}); }

}  // namespace octrad
