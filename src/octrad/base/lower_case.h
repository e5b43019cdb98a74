// Words without regard to case.
#pragma once

#include <string>

namespace octrad {

// A to Z become a to z; all other bytes stay, whatever the locale.
inline std::string lower_case(std::string text) {
  for (char& c : text) {
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
  }
  return text;
}

}  // namespace octrad
