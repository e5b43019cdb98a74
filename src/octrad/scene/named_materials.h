// Refractive indices and metals by name.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "octrad/base/vec.h"

namespace octrad {

// Index of refraction at 589.29 nm, names as in Mitsuba 3 ("bk7", "water", ...; case does not matter).
std::optional<float> named_ior(const std::string& name);
std::vector<std::string> ior_names();

// Complex index eta + i k of a conductor, averaged to RGB.
struct ConductorIor {
  Vec3f eta, k;
};
// Chemical symbols as in Mitsuba 3 ("Au", "Cu_palik" ...) and "none" (eta 0, k 1: reflects everything).
std::optional<ConductorIor> named_conductor(const std::string& name);
std::vector<std::string> conductor_names();

}  // namespace octrad
