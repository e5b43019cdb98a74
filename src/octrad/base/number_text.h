// Numbers as text that reads back as the same number.
#pragma once

#include <charconv>
#include <string>

namespace octrad {

// The shortest such text, with a point whatever the locale.
template <typename T>
std::string number_text(T value) {
  char buffer[64];
  return std::string(buffer, std::to_chars(buffer, buffer + sizeof buffer, value).ptr);
}

}  // namespace octrad
