// Amounts of memory: parsing and printing, what the process uses, and what it may use. And printing of other numbers.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace octrad {

// "4G", "512M", "64k", "1.5GiB", "1073741824" -> bytes; units are powers of 1024. Throws UsageError.
std::uint64_t parse_bytes(const std::string& text);

// "1.18 GiB", "512.0 MiB", "73 B".
std::string format_bytes(double bytes);
// "12,691".
std::string format_count(long long n);
// "1.23 M", "845 k", "12.3": a rate or count with at most three digits.
std::string format_rate(double per_second);
// "0.0625", "1.88", "-1398": three digits, but all of those before the point.
std::string format_three_digits(double value);

// Resident memory of this process in bytes (0 where unknown).
std::uint64_t resident_bytes();
// The most that was resident since the program began (0 where unknown).
std::uint64_t peak_resident_bytes();

// Memory that this process could have in all: the smaller of the system's available memory and the control group's
// limit, plus what is resident already. 0 where unknown.
std::uint64_t usable_memory();

// One line of an estimate made before anything is allocated, e.g. {"feature tables", 1270000000}.
struct MemoryPart {
  std::string name;
  std::uint64_t bytes = 0;
};
std::uint64_t total_bytes(const std::vector<MemoryPart>& parts);
// Adds `more` at the end.
void append(std::vector<MemoryPart>& parts, const std::vector<MemoryPart>& more);
// Throws MemoryError when the items together exceed `budget` bytes (0: no limit). The message lists the items, largest
// first, and ends with `advice` (which options need less, and how much).
void require_memory(std::uint64_t budget, const std::string& what, const std::vector<MemoryPart>& items,
                    const std::string& advice);

}  // namespace octrad
