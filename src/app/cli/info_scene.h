// octrad info of a scene.
#pragma once

#include <string>

#include "app/cli/common.h"

namespace octrad::cli {

// Counts, bounds, lights, the size of the cache that training would make, and the memory that training and rendering
// take. sampled: also the cells that hold one of many surface samples.
void info_scene(const CommonOptions& common, const std::string& file, const ConfigOptions& given, bool sampled);

// Everything that stands in the way of a scene; an InputError where that is something.
void info_check(const CommonOptions& common, const std::string& file, const ConfigOptions& given);

}  // namespace octrad::cli
