// Parsing and printing of durations.
#pragma once

#include <string>

namespace octrad {

// "90", "90s", "2m", "1.5h", "1h30m" -> seconds. Throws UsageError for anything else, negative or not finite.
double parse_duration(const std::string& text);

// "4.2 s", "3m 05s", "2h 07m": short, for progress lines and messages.
std::string format_duration(double seconds);

}  // namespace octrad
