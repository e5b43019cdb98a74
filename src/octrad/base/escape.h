// File names, which may be any bytes, as text.
#pragma once

#include <string>
#include <string_view>

namespace octrad {

// UTF-8 of which unescape_bytes() makes the same bytes again: bytes that are no UTF-8, and a backslash that would be
// taken for the beginning of such an escape, become \xNN.
std::string escape_bytes(std::string_view text);
std::string unescape_bytes(std::string_view text);

}  // namespace octrad
