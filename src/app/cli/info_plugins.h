// octrad info --plugins: what scene files may hold.
#pragma once

#include <string>

#include "app/cli/common.h"

namespace octrad::cli {

inline const std::string kAllPlugins = "all";

// Prints the types of objects with their parameters: all, those of a kind such as "bsdf", or one, such as
// "roughplastic". Throws UsageError for a name that is none of these.
void info_plugins(const CommonOptions& common, const std::string& name);

}  // namespace octrad::cli
