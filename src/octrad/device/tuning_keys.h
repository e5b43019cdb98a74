// The numbers of DeviceTuning by name. On the command line: -D device.KEY=VALUE.
#pragma once

#include <string>
#include <vector>

#include "octrad/device/tuning.h"

namespace octrad {

// Without "device.".
std::vector<std::string> tuning_keys();

bool operator==(const DeviceTuning& a, const DeviceTuning& b);

// Throws UsageError for a key that there is not, or a value outside of what makes sense.
void set(DeviceTuning& tuning, const std::string& key, const std::string& value);

}  // namespace octrad
