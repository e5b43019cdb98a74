// Files for tests: a temporary folder, and the shared scenes.
#pragma once

#include <cstdlib>
#include <filesystem>

#include "octrad/base/folder_test_helper.h"

namespace octrad {

// Folder of the shared scenes: $OCTRAD_SHARED, else ../shared of the project (tests run in the project's root).
inline std::filesystem::path shared_folder() {
  const char* given = std::getenv("OCTRAD_SHARED");
  return given ? std::filesystem::path(given) : std::filesystem::path("../shared");
}

}  // namespace octrad
