// Shared by the readers of single formats; private to this room.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "image/image.h"

namespace octrad::image_io {

// Throws InputError when a header asks for more than this program is willing to hold.
void check_size(const std::string& file, long long width, long long height, long long channels);

Image read_exr(const std::string& file);
Image read_hdr(const std::string& file, const std::vector<unsigned char>& bytes);
Image read_stb(const std::string& file, const std::vector<unsigned char>& bytes);  // PNG, JPEG

// Calls write(temporary name), flushes that file to disk and renames it to `file`. Removes it when anything throws.
template <typename Write>
void write_atomically(const std::string& file, Write write);

void finish_atomic_write(const std::string& temporary, const std::string& file);
void discard(const std::string& temporary) noexcept;

template <typename Write>
void write_atomically(const std::string& file, Write write) {
  const std::string temporary = file + ".tmp";
  try {
    write(temporary);
    finish_atomic_write(temporary, file);
  } catch (...) {
    discard(temporary);
    throw;
  }
}

}  // namespace octrad::image_io
