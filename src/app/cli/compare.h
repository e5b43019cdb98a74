// Parts of octrad compare in files of their own.
#pragma once

#include <string>
#include <vector>

#include "app/cli/common.h"

namespace octrad::cli {

// compare --temporal: how much the frames of a camera path flicker. Folders of frames (all pictures in order of their
// names) or text files with the name of a frame a line, relative to that file.
void compare_temporal(const CommonOptions& common, const std::string& reference,
                      const std::vector<std::string>& sequences);

}  // namespace octrad::cli
