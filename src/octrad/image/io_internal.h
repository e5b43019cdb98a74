// Shared by the readers and writers of single formats; private to this module.
#pragma once

#include <cstdint>
#include <string>

#include "octrad/image/image.h"
#include "octrad/image/io.h"

namespace octrad::image_io {

// Throws InputError for a picture that is larger than the limits of read_image() (io.h), MemoryError where the budget
// has no room for it and `beside` bytes that reading it takes.
void check_size(const std::string& file, long long width, long long height, long long channels,
                std::uint64_t beside = 0);

// `bytes`: the content of the file.
Image read_exr(const std::string& file, const std::string& bytes);
Image read_hdr(const std::string& file, const std::string& bytes);
Image read_pfm(const std::string& file, const std::string& bytes);
Image read_png(const std::string& file, const std::string& bytes);
Image read_jpeg(const std::string& file, const std::string& bytes);
Image read_webp(const std::string& file, const std::string& bytes);
Image read_bmp(const std::string& file, const std::string& bytes);
Image read_tga(const std::string& file, const std::string& bytes);

// The content of a file; `rgb` has the channels R, G, B.
std::string hdr_bytes(const Image& rgb);
std::string pfm_bytes(const Image& rgb);
std::string png_bytes(const Image8& image);
std::string jpeg_bytes(const Image8& image, int quality = 95);
// `file` is for messages.
std::string exr_bytes(const std::string& file, const Image& image, const ExrSettings& settings);

}  // namespace octrad::image_io
