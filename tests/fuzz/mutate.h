// Changes for libFuzzer that keep more of a file readable than its own do.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace octrad::fuzz {

// One change of `bytes`, a file of `target`, by up to `room` bytes more or so; parts may be taken from `from`.
std::string changed_file(std::string_view target, const std::string& bytes, const std::string& from, std::size_t room,
                         unsigned seed);

}  // namespace octrad::fuzz
