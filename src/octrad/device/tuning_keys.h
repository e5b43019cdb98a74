// The numbers of DeviceTuning by name. On the command line: -D device.KEY=VALUE.
#pragma once

#include <span>
#include <string>

#include "octrad/device/tuning.h"

namespace octrad {

struct TuningKey {
  const char* name;     // without "device."
  const char* meaning;  // half a sentence
};
std::span<const TuningKey> tuning_keys();

bool operator==(const DeviceTuning& a, const DeviceTuning& b);

// Throws UsageError for a key that there is not, or a value outside of what makes sense.
void set(DeviceTuning& tuning, const std::string& key, const std::string& value);

}  // namespace octrad
