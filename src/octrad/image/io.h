// Pictures on disk.
//
// Metadata keys with a meaning here:
//   "encoding"        "srgb8": values in [0, 1] still sRGB-encoded (PNG and JPEG, whatever their depth); "linear"
//   (HDR).
//                     EXR files are linear and get no such key.
//   "dataWindow.min"  "x y": where the picture lies in a larger display window (a crop); absent for 0 0.
//   "displayWindow"   "width height" of that display window; absent when it is the picture itself.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "octrad/image/image.h"

namespace octrad {

// 8-bit picture for display, interleaved, row 0 at the top; 1 (grey), 3 (RGB) or 4 (RGBA) channels.
struct Image8 {
  int width = 0, height = 0, channels = 3;
  std::vector<std::uint8_t> data;

  Image8() = default;
  Image8(int w, int h, int c)
      : width(w),
        height(h),
        channels(c),
        data(static_cast<std::size_t>(w) * static_cast<std::size_t>(h) * static_cast<std::size_t>(c)) {}
};

// Reads EXR, PNG, JPEG or Radiance HDR; the content decides, not the name.
//
// EXR: scanline or tiled (full resolution), any compression that the OpenEXR library knows, half, float and uint
// channels, the first part; channels are ordered by layer, main picture first, and R, G, B, A or X, Y, Z within one.
// String attributes become metadata. PNG, JPEG: 8 or 16 bits, channels Y | Y, A | R, G, B | R, G, B, A.
//
// Throws IoError when the file cannot be read, InputError when it is broken, not a picture, or larger than
// 131072 pixels a side or 4 GiB in memory (checked before anything is allocated). Both name the file.
Image read_image(const std::string& file);

enum class ExrPrecision { float32, half };

// Writes an EXR file: scanlines, ZIP, channels by name, metadata as string attributes. A new file is written first and
// renamed, so an old file survives any failure. Missing folders are an IoError.
void write_exr(const std::string& file, const Image& image, ExrPrecision precision = ExrPrecision::float32);

// Writes an 8-bit PNG, as atomically.
void write_png(const std::string& file, const Image8& image);

}  // namespace octrad
