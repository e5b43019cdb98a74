// Files that are read as a whole.
#pragma once

#include <string>

namespace octrad {

// The content of a regular file; the memory budget is asked first. Devices, pipes and folders are refused: they have no
// size, and reading one may never end. Throws IoError or MemoryError, naming the file.
std::string read_file(const std::string& file);

}  // namespace octrad
