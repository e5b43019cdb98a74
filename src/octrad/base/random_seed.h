// Numbers that differ from run to run.
#pragma once

#include <cstdint>

namespace octrad {

// From the system's generator. Not std::random_device: libstdc++ 12 takes a function of glibc 2.36 for it, and binaries
// that are carried to other machines must do with 2.34.
std::uint64_t random_seed();

}  // namespace octrad
