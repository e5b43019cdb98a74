// Pictures on disk.
//
// Metadata keys with a meaning here:
//   "encoding"        "srgb8": values in [0, 1] still sRGB-encoded (PNG, JPEG, WebP, BMP and TGA, whatever
//                     their depth); "linear" (HDR, PFM). EXR files are linear and get no such key.
//   "dataWindow.min"  "x y": where the picture lies in a larger display window (a crop); absent for 0 0.
//   "displayWindow"   "width height" of that display window; absent when it is the picture itself.
#pragma once

#include <string>
#include <vector>

#include "octrad/image/image.h"
#include "octrad/image/tonemap_math.h"

namespace octrad {

// Reads EXR, PNG, JPEG, WebP, Radiance HDR, PFM, BMP or TGA; the format is recognised by content, only TGA also by
// name.
//
// EXR: scanline or tiled (full resolution), any compression that the OpenEXR library knows, half, float and uint
// channels; of several parts the first flat one, and the channels of those of the same size under their names as
// layers. Where no channels are called R, G, B or Y, those of the layer that is the picture are (exr.cc). Channels are
// ordered by layer, main picture first, and R, G, B, A or X, Y, Z within one. String attributes become metadata. PNG,
// JPEG: 8 or 16 bits, channels Y | Y, A | R, G, B | R, G, B, A. WebP: 8 bits, R, G, B or R, G, B, A; no animation.
//
// BMP: uncompressed, 1 to 32 bits. TGA: grey, colour, palettes, plain or run-length encoded. Without their alpha.
//
// CMYK becomes what it looks like without a profile; colour profiles and gamma chunks are not looked at.
//
// Throws IoError when the file cannot be read, InputError when it is broken, cut off, not a picture, or larger than
// 131072 pixels a side or 32 GiB in memory, MemoryError when it is above the memory budget (checked before anything is
// allocated). All name the file.
Image read_image(const std::string& file);
// The same of a file's content; `file` is for messages.
Image parse_image(const std::string& file, const std::string& bytes);
// Whether the name ends as those of pictures do, in any case.
bool is_picture_name(const std::string& file);
// Whether this is the content of a WebP file, which Mitsuba does not read.
bool is_webp(const std::string& bytes);

enum class ExrPrecision { float32, half };

struct ExrSettings {
  ExrPrecision precision = ExrPrecision::float32;  // half: 10 bits after the point, magnitudes up to 65504
  std::string compression = "zip";                 // one of exr_compressions()
};
// "none", "rle", "zips", "zip", "piz" keep what is written; "pxr24" cuts floats to 24 bits; "b44", "b44a" (of halves),
// "dwaa", "dwab" keep what is seen.
const std::vector<std::string>& exr_compressions();

// Writes an EXR file: scanlines, channels by name, metadata as string attributes. A new file is written first and
// renamed, so an old file survives any failure. Missing folders are an IoError.
void write_exr(const std::string& file, const Image& image, const ExrSettings& settings = {});

enum class PictureFormat { exr, hdr, pfm, png, jpeg };

// By the ending of the name, in any case: .exr, .hdr, .pfm, .png, .jpg, .jpeg. A device such as /dev/null counts as
// EXR. Throws UsageError that lists the endings; call it before long work whose result goes to `file`.
PictureFormat picture_format(const std::string& file);
// Throws UsageError where a picture of this size cannot be such a file: JPEG has at most 65500 pixels a side.
void require_format_size(const std::string& file, int width, int height);
// PNG and JPEG: 8 bits a channel for the screen, where EXR, HDR and PFM hold linear radiance.
inline bool is_display_format(PictureFormat format) {
  return format == PictureFormat::png || format == PictureFormat::jpeg;
}

// Writes what the ending of the name says, as atomically as write_exr(). EXR: everything. HDR and PFM: the colour. PNG
// and JPEG: the colour through `mapping`.
void write_image(const std::string& file, const Image& image, const ToneMapping& mapping = {},
                 const ExrSettings& exr = {});
// PNG or JPEG (quality 95; 1 or 3 channels); throws UsageError for a name with another ending.
void write_image(const std::string& file, const Image8& image);

}  // namespace octrad
