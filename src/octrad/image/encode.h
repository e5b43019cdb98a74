// Pictures as the bytes of a file, for what is sent and not saved.
#pragma once

#include <string>

#include "octrad/image/io.h"

namespace octrad {

// 1 or 3 channels; `quality` 1 ... 100, colours at full resolution.
std::string encode_jpeg(const Image8& image, int quality = 95);
std::string encode_png(const Image8& image);
// What write_exr() writes. Throws as it does; `name` is what messages call the picture.
std::string encode_exr(const std::string& name, const Image& image, const ExrSettings& settings = {});
// What write_image() writes, by the ending of `name`.
std::string encode_image(const std::string& name, const Image& image, const ToneMapping& mapping = {},
                         const ExrSettings& exr = {});

}  // namespace octrad
