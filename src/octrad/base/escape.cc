#include "octrad/base/escape.h"

#include <algorithm>
#include <cstddef>

namespace octrad {
namespace {

constexpr char kDigits[] = "0123456789abcdef";

int hex_value(char c) {
  if (c >= '0' && c <= '9') return c - '0';
  const char lower = static_cast<char>(c | 0x20);
  return lower >= 'a' && lower <= 'f' ? lower - 'a' + 10 : -1;
}

// Value of the escape \xNN at `i`; -1 where there is none.
int escape_at(std::string_view text, std::size_t i) {
  if (i + 3 >= text.size() || text[i] != '\\' || text[i + 1] != 'x') return -1;
  const int high = hex_value(text[i + 2]), low = hex_value(text[i + 3]);
  return high < 0 || low < 0 ? -1 : 16 * high + low;
}

// Bytes of the character at `i` (RFC 3629: shortest form, no surrogates, at most U+10FFFF); 0 where there is none.
std::size_t utf8_length(std::string_view text, std::size_t i) {
  const auto byte = [&](std::size_t k) { return static_cast<unsigned char>(text[i + k]); };
  const unsigned first = byte(0);
  if (first < 0x80) return 1;
  const std::size_t length = first >= 0xf0 ? 4 : first >= 0xe0 ? 3 : 2;
  if (first < 0xc2 || first > 0xf4 || i + length > text.size()) return 0;
  for (std::size_t k = 1; k < length; ++k) {
    if ((byte(k) & 0xc0u) != 0x80u) return 0;
  }
  const unsigned second = byte(1);
  if ((first == 0xe0 && second < 0xa0) || (first == 0xed && second > 0x9f) || (first == 0xf0 && second < 0x90) ||
      (first == 0xf4 && second > 0x8f))
    return 0;
  return length;
}

// What unescape_bytes() takes for an escape.
bool is_escape(int value) { return value == '\\' || value >= 0x80; }

// `text` with \xNN for each byte that keep(i, length) does not keep: the bytes from i on are a code point of `length`
// bytes of UTF-8, or none where it is 0.
template <typename Keep>
std::string escape_unless(std::string_view text, Keep keep) {
  std::string out;
  out.reserve(text.size());
  for (std::size_t i = 0; i < text.size();) {
    const std::size_t length = utf8_length(text, i);
    if (keep(i, length)) {
      out.append(text, i, length);
      i += length;
    } else {
      const auto byte = static_cast<unsigned char>(text[i++]);
      out += {'\\', 'x', kDigits[byte >> 4], kDigits[byte & 15u]};
    }
  }
  return out;
}

}  // namespace

std::string escape_bytes(std::string_view text) {
  return escape_unless(text,
                       [&](std::size_t i, std::size_t length) { return length > 0 && !is_escape(escape_at(text, i)); });
}

std::string printable(const std::string& text) {
  const auto is_plain = [](char c) { return (c >= ' ' && c <= '~') || c == '\n' || c == '\t'; };
  if (std::all_of(text.begin(), text.end(), is_plain)) return text;
  return escape_unless(text, [&](std::size_t i, std::size_t length) {
    // U+0080 to U+009F are control characters as well: some terminals take them for the beginning of a sequence.
    const bool control = length == 2 && text[i] == '\xc2' && static_cast<unsigned char>(text[i + 1]) < 0xa0;
    return (length > 1 && !control) || is_plain(text[i]);
  });
}

std::string unescape_bytes(std::string_view text) {
  std::string out;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const int value = escape_at(text, i);
    out += is_escape(value) ? static_cast<char>(value) : text[i];
    if (is_escape(value)) i += 3;
  }
  return out;
}

std::string markup_text(const std::string& text) {
  std::string out;
  for (const char c : text) {
    switch (c) {
      case '&': out += "&amp;"; break;
      case '<': out += "&lt;"; break;
      case '>': out += "&gt;"; break;
      case '"': out += "&quot;"; break;
      default: out += c;
    }
  }
  return out;
}

std::string shell_text(const std::vector<std::string>& words) {
  std::string line;
  for (const std::string& word : words) {
    const bool plain =
        !word.empty() &&
        word.find_first_not_of("abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789-_./=,:+@%") ==
            std::string::npos;
    std::string quoted;
    for (const char c : word) quoted += c == '\'' ? "'\\''" : std::string(1, c);
    if (!line.empty()) line += " ";
    line += plain ? word : "'" + quoted + "'";
  }
  return line;
}

}  // namespace octrad
