// Shared by the readers and writers of single formats; private to this module.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "octrad/image/image.h"

namespace octrad::image_io {

// Throws InputError for a picture that is larger than the limits of read_image() (io.h).
void check_size(const std::string& file, long long width, long long height, long long channels);

Image read_exr(const std::string& file);
Image read_hdr(const std::string& file, const std::vector<unsigned char>& bytes);
Image read_pfm(const std::string& file, const std::vector<unsigned char>& bytes);
Image read_stb(const std::string& file, const std::vector<unsigned char>& bytes);  // PNG, JPEG

// The content of a file; `rgb` has the channels R, G, B.
std::string hdr_bytes(const Image& rgb);
std::string pfm_bytes(const Image& rgb);
std::string png_bytes(const Image8& image);
std::string jpeg_bytes(const Image8& image);

}  // namespace octrad::image_io
