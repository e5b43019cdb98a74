#include "octrad/image/encode.h"

#include "octrad/image/io_internal.h"

namespace octrad {

std::string encode_jpeg(const Image8& image, int quality) { return image_io::jpeg_bytes(image, quality); }

std::string encode_png(const Image8& image) { return image_io::png_bytes(image); }

std::string encode_exr(const std::string& name, const Image& image, const ExrSettings& settings) {
  return image_io::exr_bytes(name, image, settings);
}

}  // namespace octrad
