// The library's version, such as "0.2.0"; set in CMakeLists.txt.
#pragma once

namespace octrad {
extern const char* const kVersion;
}
