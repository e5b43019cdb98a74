// This module's kernels, and what is drawn on a device, against the CPU.
#pragma once

#include <cstdint>

#include "octrad/device/check.h"

namespace octrad {

CheckResult check_random_numbers(Stream& stream, std::size_t n, std::uint64_t seed);
CheckResult check_sobol(Stream& stream, std::size_t n);
// Counts n random words by their last bits. n < 2^24: floats count exactly until there.
CheckResult check_atomics(Stream& stream, std::size_t n, std::uint64_t seed);
CheckResult check_appends(Stream& stream, std::size_t n, std::uint64_t seed);
// Places that sort_pairs() gives to keys of `bits` bits.
CheckResult check_sort(Stream& stream, std::size_t n, int bits, std::uint64_t seed);
CheckResult check_scan(Stream& stream, std::size_t n, std::uint64_t seed);  // in place, wrapping around
CheckResult check_sum(Stream& stream, std::size_t n, std::uint64_t seed);   // and that it repeats bit for bit

}  // namespace octrad
