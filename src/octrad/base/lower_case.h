// Words without regard to case.
#pragma once

#include <filesystem>
#include <string>

namespace octrad {

// A to Z become a to z; all other bytes stay, whatever the locale.
inline std::string lower_case(std::string text) {
  for (char& c : text) {
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
  }
  return text;
}

// The ending of a file's name, with its dot, in small letters; empty without one.
inline std::string ending_of(const std::string& file) {
  return lower_case(std::filesystem::path(file).extension().string());
}

}  // namespace octrad
