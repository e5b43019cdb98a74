// WebP, as glTF files have it, through libwebp. 8 bits a channel; the first picture of an animation is none.
#include <webp/decode.h>

#include "octrad/base/error.h"
#include "octrad/image/io_internal.h"

namespace octrad {

Image image_io::read_webp(const std::string& file, const std::string& bytes) {
  const auto* data = reinterpret_cast<const std::uint8_t*>(bytes.data());
  const auto fail = [&] { throw InputError(file + ": broken or truncated WebP file"); };
  WebPBitstreamFeatures features;
  if (WebPGetFeatures(data, bytes.size(), &features) != VP8_STATUS_OK) fail();
  if (features.has_animation) throw InputError(file + ": animated WebP is not supported");
  const int channels = features.has_alpha ? 4 : 3;
  const auto pixels = static_cast<std::uint64_t>(features.width) * static_cast<std::uint64_t>(features.height);
  // Beside: what the library keeps of a lossless picture, 4 bytes a pixel, and the bytes of its result.
  check_size(file, features.width, features.height, channels, pixels * (4 + static_cast<std::uint64_t>(channels)));
  const int stride = features.width * channels;
  std::vector<std::uint8_t> values(pixels * static_cast<std::uint64_t>(channels));
  const auto decode = channels == 4 ? WebPDecodeRGBAInto : WebPDecodeRGBInto;
  if (!decode(data, bytes.size(), values.data(), values.size(), stride)) fail();
  std::vector<std::string> names{"R", "G", "B"};
  if (channels == 4) names.push_back("A");
  Image image(features.width, features.height, std::move(names));
  for (std::size_t i = 0; i < values.size(); ++i) image.data[i] = static_cast<float>(values[i]) * (1.0f / 255.0f);
  image.metadata["encoding"] = "srgb8";
  return image;
}

}  // namespace octrad
