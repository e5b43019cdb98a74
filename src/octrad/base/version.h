// The program's version, as in CMakeLists.txt.
#pragma once

namespace octrad {
inline constexpr char kVersion[] = "0.1.0";
}
