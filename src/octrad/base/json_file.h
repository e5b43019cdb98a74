// The one reader of JSON that others wrote: configurations, cameras, matrices, metadata of models and pictures.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

namespace octrad {

// Comments are allowed. Throws InputError with the position of a syntax error, as NAME:LINE:COLUMN, for lists and
// objects that are nested more than 100 deep, and for numbers that a double cannot hold; MemoryError above the budget.
nlohmann::json parse_json(const std::string& text, const std::string& name);
// A discarded value (is_discarded()) instead of an InputError: for text that may be JSON.
nlohmann::json parse_json_or_discard(const std::string& text);
// parse_json() of a file. Throws IoError when it cannot be read.
nlohmann::json read_json_file(const std::string& file);

// The whole number from `low` to `high` that `value` is; 4.0 is one, too. Throws InputError, "WHAT must be a whole
// number from ...", for all else: 1.5, 1e300, texts.
long long whole_number(const nlohmann::json& value, long long low, long long high, const std::string& what);

// As value.dump(indent), but texts and keys may be any bytes, such as names of files: see escape_bytes().
std::string json_text(const nlohmann::json& value, int indent = -1);
// The same without the control characters that JSON allows and terminals obey (DEL, U+0080 to U+009F), which are
// escaped.
std::string printable_json_text(const nlohmann::json& value, int indent = -1);

}  // namespace octrad
