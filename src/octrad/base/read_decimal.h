// Decimal numbers of text files.
#pragma once

#include <charconv>
#include <cstdlib>
#include <string>
#include <system_error>

namespace octrad {

// As std::from_chars, which leaves numbers out of range alone: here they are 0 where they are too small and infinite
// where they are too large.
template <typename T>
std::from_chars_result read_decimal(const char* begin, const char* end, T& value) {
  std::from_chars_result result = std::from_chars(begin, end, value);
  if (result.ec != std::errc::result_out_of_range) return result;
  value = static_cast<T>(std::strtod(std::string(begin, result.ptr).c_str(), nullptr));
  return {result.ptr, std::errc()};
}

}  // namespace octrad
