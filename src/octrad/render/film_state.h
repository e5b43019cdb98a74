// Unfinished pictures on disk (docs/formats.md): what a later run goes on from.
#pragma once

#include <map>
#include <string>

#include "octrad/render/renderer.h"

namespace octrad {

// What two runs must share for the second to go on with the first one's samples: "scene" -> its fingerprint, and so on.
using FilmIdentity = std::map<std::string, std::string>;

// Replaces `file`; it survives any failure. Throws IoError.
void write_film_state(const std::string& file, const FilmState& state, const FilmIdentity& identity);
// Throws IoError, or InputError for what is no such file, or for one of another identity, saying in what it differs.
FilmState read_film_state(const std::string& file, const FilmIdentity& identity);

}  // namespace octrad
