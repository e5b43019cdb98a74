// JSON that users write.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

namespace octrad {

// Comments are allowed. Throws InputError with the position of a syntax error, as NAME:LINE:COLUMN, or for lists and
// objects that are nested more than 100 deep.
nlohmann::json parse_json(const std::string& text, const std::string& name);
// The same of a file. Throws IoError when it cannot be read.
nlohmann::json read_json_file(const std::string& file);

// As value.dump(indent), but texts and keys may be any bytes, such as names of files: see escape_bytes().
std::string json_text(const nlohmann::json& value, int indent = -1);

}  // namespace octrad
