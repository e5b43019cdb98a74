#include "octrad/base/printable.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstddef>

namespace octrad {
namespace {

bool is_plain(char c) { return (c >= ' ' && c <= '~') || c == '\n' || c == '\t'; }

// Bytes of the UTF-8 character at `i`; 0 where there is none: overlong, a surrogate, above U+10FFFF, cut off.
std::size_t utf8_length(const std::string& text, std::size_t i) {
  const auto byte = [&](std::size_t k) { return i + k < text.size() ? static_cast<unsigned char>(text[i + k]) : 0u; };
  const unsigned first = byte(0);
  const std::size_t n = first < 0x80 ? 1 : first >> 5 == 6 ? 2 : first >> 4 == 14 ? 3 : first >> 3 == 30 ? 4 : 0;
  if (n <= 1) return n;
  unsigned code = first & (0xffu >> (n + 1));
  for (std::size_t k = 1; k < n; ++k) {
    if (byte(k) >> 6 != 2) return 0;
    code = code << 6 | (byte(k) & 0x3f);
  }
  const unsigned least = n == 2 ? 0x80 : n == 3 ? 0x800 : 0x10000;
  return code < least || (code >= 0xd800 && code < 0xe000) || code > 0x10ffff ? 0 : n;
}

}  // namespace

std::string printable(const std::string& text) {
  if (std::all_of(text.begin(), text.end(), is_plain)) return text;
  std::string out;
  for (std::size_t i = 0; i < text.size();) {
    const std::size_t n = utf8_length(text, i);
    // U+0080 to U+009F are control characters too: some terminals take them for escape sequences.
    const bool control = n == 2 && text[i] == '\xc2' && static_cast<unsigned char>(text[i + 1]) < 0xa0;
    if (n > 1 && !control) out.append(text, i, n);
    else if (is_plain(text[i])) out += text[i];
    else out += fmt::format("\\x{:02x}", static_cast<unsigned char>(text[i]));
    i += n > 1 && !control ? n : 1;
  }
  return out;
}

}  // namespace octrad
