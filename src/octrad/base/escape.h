// Text that may be any bytes, such as names of files, as text that can be kept and shown.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace octrad {

// UTF-8 of which unescape_bytes() makes the same bytes again: bytes that are no UTF-8, and a backslash that would be
// taken for the beginning of such an escape, become \xNN.
std::string escape_bytes(std::string_view text);
std::string unescape_bytes(std::string_view text);

// For a terminal: control characters too (all but newline and tab) become \xNN, so that text of a stranger's file
// cannot move the cursor, set the title or hide what was printed.
std::string printable(const std::string& text);

// A command line of these words, quoted where a shell would take them for something else.
std::string shell_text(const std::vector<std::string>& words);

// For XML and HTML: & < > " as entities.
std::string markup_text(const std::string& text);

}  // namespace octrad
