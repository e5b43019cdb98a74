// Windows bitmaps (.bmp): uncompressed, with a palette or of 16, 24 or 32 bits. Layout as Microsoft's documentation of
// BITMAPFILEHEADER, BITMAPINFOHEADER and its later versions describes it.
#include <bit>
#include <cstdint>

#include "octrad/base/error.h"
#include "octrad/image/io_internal.h"

namespace octrad {
namespace {

// Little-endian numbers of a file in memory.
class Bytes {
 public:
  Bytes(const std::string& file, const std::string& bytes) : file_(file), bytes_(bytes) {}
  std::uint32_t at(std::size_t offset, int count) const {
    if (offset + static_cast<std::size_t>(count) > bytes_.size()) throw InputError(file_ + ": truncated BMP file");
    std::uint32_t value = 0;
    for (int i = count - 1; i >= 0; --i)
      value = value << 8 | static_cast<unsigned char>(bytes_[offset + static_cast<std::size_t>(i)]);
    return value;
  }
  std::int32_t signed_at(std::size_t offset) const { return static_cast<std::int32_t>(at(offset, 4)); }

 private:
  const std::string& file_;
  const std::string& bytes_;
};

// A channel of a pixel of 16 or 32 bits.
struct Mask {
  std::uint32_t bits;
  float value(std::uint32_t pixel) const {
    if (bits == 0) return 0.0f;
    const int shift = std::countr_zero(bits);
    return static_cast<float>(static_cast<double>((pixel & bits) >> shift) / static_cast<double>(bits >> shift));
  }
};

}  // namespace

Image image_io::read_bmp(const std::string& file, const std::string& bytes) {
  const Bytes b(file, bytes);
  const std::size_t header = b.at(14, 4);
  const bool old = header == 12;  // OS/2: sizes of 16 bits, palettes of three bytes an entry
  if (!old && (header < 40 || header > 124)) throw InputError(file + ": BMP header of unknown size");
  const long long width = old ? b.at(18, 2) : static_cast<long long>(b.signed_at(18));
  const long long signed_height = old ? b.at(20, 2) : static_cast<long long>(b.signed_at(22));
  const long long height = std::llabs(signed_height);
  const int depth = static_cast<int>(b.at(old ? 24 : 28, 2));
  const std::uint32_t compression = old ? 0 : b.at(30, 4);
  if (compression != 0 && compression != 3 && compression != 6)
    throw InputError(file + ": compressed BMP pictures are not supported; save it without compression, or as PNG");
  if (depth != 1 && depth != 4 && depth != 8 && depth != 16 && depth != 24 && depth != 32)
    throw InputError(file + ": BMP of " + std::to_string(depth) +
                     " bits a pixel; 1, 4, 8, 16, 24 and 32 are supported");
  check_size(file, width, height, 3);
  Mask masks[3] = {{0x7c00}, {0x3e0}, {0x1f}};
  if (depth == 32) masks[0] = {0xff0000}, masks[1] = {0xff00}, masks[2] = {0xff};
  if (compression != 0) {
    for (std::size_t c = 0; c < 3; ++c) masks[c] = {b.at(54 + 4 * c, 4)};
  }
  const std::size_t pixels = b.at(10, 4), palette = 14 + header, entry = old ? 3 : 4;
  const std::size_t stride = (static_cast<std::size_t>(width) * static_cast<std::size_t>(depth) + 31) / 32 * 4;
  if (pixels > bytes.size() || stride * static_cast<std::size_t>(height) > bytes.size() - pixels)
    throw InputError(file + ": truncated BMP file");
  Image image(static_cast<int>(width), static_cast<int>(height), {"R", "G", "B"});
  image.metadata["encoding"] = "srgb8";
  for (int y = 0; y < image.height; ++y) {
    const auto row = static_cast<std::size_t>(signed_height < 0 ? y : image.height - 1 - y);
    for (int x = 0; x < image.width; ++x) {
      const std::size_t bit = static_cast<std::size_t>(x) * static_cast<std::size_t>(depth);
      const std::size_t at = pixels + row * stride + bit / 8;
      std::size_t blue = at;  // of three bytes: blue, green, red
      if (depth == 16 || depth == 32) {
        const std::uint32_t pixel = b.at(at, depth / 8);
        image.set_rgb(x, y, {masks[0].value(pixel), masks[1].value(pixel), masks[2].value(pixel)});
        continue;
      }
      if (depth < 24) {
        const std::uint32_t index = b.at(at, 1) >> (8 - depth - static_cast<int>(bit % 8)) & ((1u << depth) - 1u);
        blue = palette + index * entry;
      }
      const auto channel = [&](std::size_t c) { return static_cast<float>(b.at(blue + c, 1)) / 255.0f; };
      image.set_rgb(x, y, {channel(2), channel(1), channel(0)});
    }
  }
  return image;
}

}  // namespace octrad
