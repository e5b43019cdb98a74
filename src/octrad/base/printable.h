// Text of files and file names on a terminal.
#pragma once

#include <string>

namespace octrad {

// Control characters (all but newline and tab) and bytes that are no UTF-8 become \xNN, so that text of a stranger's
// file cannot move the cursor, set the title or hide what was printed.
std::string printable(const std::string& text);

}  // namespace octrad
