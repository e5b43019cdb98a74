#include "octrad/base/json_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <nlohmann/json.hpp>

#include "octrad/base/error.h"
#include "octrad/base/escape.h"
#include "octrad/base/input_file.h"
#include "octrad/base/memory_limit.h"

namespace octrad {

namespace {

// Lists and objects in each other, of text that is JSON with comments.
int deepest_nesting(const std::string& text) {
  int open = 0, most = 0;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const char c = text[i], next = i + 1 < text.size() ? text[i + 1] : '\0';
    if (c == '"') {
      for (++i; i < text.size() && text[i] != '"'; ++i) i += text[i] == '\\' ? 1 : 0;
    } else if (c == '/' && next == '/') {
      i = std::min(text.find_first_of("\r\n", i), text.size());
    } else if (c == '/' && next == '*') {
      i = std::min(text.find("*/", i + 2), text.size() - 1) + 1;  // its last character begins no other comment
    } else if (c == '[' || c == '{') {
      most = std::max(most, ++open);
    } else if (c == ']' || c == '}') {
      --open;
    }
  }
  return most;
}

}  // namespace

nlohmann::json parse_json(const std::string& text, const std::string& name) {
  // A list "[]," of 3 bytes is a value, a vector and what its parent's vector has in reserve; a text is a copy.
  const auto marks =
      std::count_if(text.begin(), text.end(), [](char c) { return c == ',' || c == ':' || c == '[' || c == '{'; });
  ask_memory(text.size() * 2 + static_cast<std::uint64_t>(marks) * 48, name);
  // Values of any depth can be parsed, but neither copied nor written: those functions call themselves for each level.
  // Not by the library's callback: with one, each object that ends is looked for among all that are beside it.
  if (deepest_nesting(text) > 100)
    throw InputError(fmt::format("{}: lists or objects are nested more than 100 deep", name));
  try {
    return nlohmann::json::parse(text, nullptr, true, true);  // comments allowed
  } catch (const nlohmann::json::parse_error& error) {
    const std::size_t end = std::min(text.size(), error.byte > 0 ? error.byte - 1 : 0);
    const auto line = 1 + std::count(text.begin(), text.begin() + static_cast<std::ptrdiff_t>(end), '\n');
    const std::size_t start = end == 0 ? std::string::npos : text.rfind('\n', end - 1);
    const std::size_t column = start == std::string::npos ? end + 1 : end - start;
    const bool bytes = std::string_view(error.what()).find("UTF-8") != std::string_view::npos;
    throw InputError(fmt::format("{}:{}:{}: not valid JSON{}", name, line, column, bytes ? ": not UTF-8" : ""));
  } catch (const nlohmann::json::out_of_range&) {
    throw InputError(fmt::format("{}: a number is too large for a floating-point number", name));
  }
}

nlohmann::json parse_json_or_discard(const std::string& text) {
  try {
    return parse_json(text, "JSON");
  } catch (const InputError&) {
    return nlohmann::json::value_t::discarded;
  }
}

namespace {

nlohmann::json escaped(const nlohmann::json& value) {
  if (value.is_string()) return escape_bytes(value.get_ref<const std::string&>());
  nlohmann::json out = value;
  if (value.is_array()) {
    for (nlohmann::json& element : out) element = escaped(element);
  } else if (value.is_object()) {
    out.clear();
    for (const auto& [key, element] : value.items()) out[escape_bytes(key)] = escaped(element);
  }
  return out;
}

}  // namespace

std::string json_text(const nlohmann::json& value, int indent) {
  try {
    return value.dump(indent);
  } catch (const nlohmann::json::type_error&) {  // bytes that are no UTF-8
    return escaped(value).dump(indent);
  }
}

std::string printable_json_text(const nlohmann::json& value, int indent) {
  const std::string text = json_text(value, indent);
  std::string out;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const auto byte = static_cast<unsigned char>(text[i]);
    const auto next = static_cast<unsigned char>(i + 1 < text.size() ? text[i + 1] : 0);
    if (byte == 0x7f) {
      out += "\\u007f";
    } else if (byte == 0xc2 && next >= 0x80 && next < 0xa0) {  // the two bytes of U+0080 to U+009F
      out += fmt::format("\\u{:04x}", next);
      ++i;
    } else {
      out += text[i];
    }
  }
  return out;
}

long long whole_number(const nlohmann::json& value, long long low, long long high, const std::string& what) {
  constexpr double kExact = 9007199254740992.0;  // 2^53: up to here a double is the number that was written
  const double number = value.is_number() ? value.get<double>() : 0.5;
  const bool fits = value.is_number_integer()
                        ? !value.is_number_unsigned() || value.get<std::uint64_t>() <= std::uint64_t{INT64_MAX}
                        : std::fabs(number) <= kExact && number == std::floor(number);
  const long long whole = fits ? value.get<long long>() : 0;
  if (!fits || whole < low || whole > high)
    throw InputError(fmt::format("{} must be a whole number from {} to {}, not {}", what, low, high,
                                 value.is_number() ? value.dump() : value.type_name()));
  return whole;
}

nlohmann::json read_json_file(const std::string& file) { return parse_json(read_file(file), file); }

}  // namespace octrad
