#include "octrad/image/encode.h"

#include "octrad/image/io_internal.h"
#include "octrad/image/tonemap.h"

namespace octrad {

std::string encode_jpeg(const Image8& image, int quality) { return image_io::jpeg_bytes(image, quality); }

std::string encode_png(const Image8& image) { return image_io::png_bytes(image); }

std::string encode_exr(const std::string& name, const Image& image, const ExrSettings& settings) {
  return image_io::exr_bytes(name, image, settings);
}

std::string encode_image(const std::string& name, const Image& image, const ToneMapping& mapping,
                         const ExrSettings& exr) {
  switch (picture_format(name)) {
    case PictureFormat::exr: return image_io::exr_bytes(name, image, exr);
    case PictureFormat::hdr: return image_io::hdr_bytes(extract_rgb(image));
    case PictureFormat::pfm: return image_io::pfm_bytes(extract_rgb(image));
    case PictureFormat::png: return image_io::png_bytes(tonemap(image, mapping));
    case PictureFormat::jpeg: break;
  }
  return image_io::jpeg_bytes(tonemap(image, mapping));
}

}  // namespace octrad
