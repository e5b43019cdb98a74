// Whether tests run under a sanitizer, where everything takes ten times as long: scripts/test.sh says so.
#pragma once

#include <cstdlib>

namespace octrad::testing {

inline bool sanitized() { return std::getenv("OCTRAD_SANITIZED") != nullptr; }

}  // namespace octrad::testing
