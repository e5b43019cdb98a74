// PNG and JPEG through the stb single-file libraries; their one implementation in this program.
#include <algorithm>
#include <cstdlib>
#include <memory>

#include "octrad/base/error.h"
#include "octrad/image/io_internal.h"

#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wconversion"
#pragma GCC diagnostic ignored "-Wsign-conversion"
#pragma GCC diagnostic ignored "-Wshadow"
#pragma GCC diagnostic ignored "-Wunused-function"
#pragma GCC diagnostic ignored "-Wunused-parameter"
#pragma GCC diagnostic ignored "-Wmissing-field-initializers"
#define STB_IMAGE_STATIC
#define STB_IMAGE_IMPLEMENTATION
#define STBI_ONLY_PNG
#define STBI_ONLY_JPEG
#define STBI_NO_STDIO
#define STBI_NO_LINEAR
#define STBI_MAX_DIMENSIONS 131072
#include <stb_image.h>
#define STB_IMAGE_WRITE_STATIC
#define STB_IMAGE_WRITE_IMPLEMENTATION
#define STBI_WRITE_NO_STDIO
#include <stb_image_write.h>
#pragma GCC diagnostic pop

namespace octrad {

Image image_io::read_stb(const std::string& file, const std::vector<unsigned char>& bytes) {
  const int size = static_cast<int>(bytes.size());
  const auto fail = [&]() -> InputError {
    const char* reason = stbi_failure_reason();
    return InputError(file + ": broken picture: " + (reason != nullptr ? reason : "unknown reason"));
  };
  int width = 0, height = 0, channels = 0;
  if (stbi_info_from_memory(bytes.data(), size, &width, &height, &channels) == 0) {
    // stb's info call reports the reason of the last format that it tried; its load call stops at the matching format
    // and gives a better one.
    stbi_image_free(stbi_load_from_memory(bytes.data(), size, &width, &height, &channels, 0));
    throw fail();
  }
  check_size(file, width, height, channels);
  const bool jpeg = bytes[0] == 0xff;
  if (jpeg) {
    // stb fills what is missing at the end with grey and reports success. Neither marker occurs inside coded data, and
    // a thumbnail's own end marker precedes the last start of scan.
    const unsigned char scan[2] = {0xff, 0xda}, end[2] = {0xff, 0xd9};
    const auto last_scan = std::find_end(bytes.begin(), bytes.end(), scan, scan + 2);
    if (std::search(last_scan, bytes.end(), end, end + 2) == bytes.end())
      throw InputError(file + ": truncated JPEG file");
    // A block of 8 x 8 pixels takes at least a bit.
    if (static_cast<double>(size) * 1024.0 < static_cast<double>(width) * height)
      throw InputError(file + ": truncated JPEG file");
  } else if (static_cast<double>(size) * 8192.0 < static_cast<double>(width) * height * channels) {
    throw InputError(file + ": truncated PNG file");  // deflate gains at most a factor of 1032
  }

  const std::vector<std::string> names = channels == 1   ? std::vector<std::string>{"Y"}
                                         : channels == 2 ? std::vector<std::string>{"Y", "A"}
                                         : channels == 3 ? std::vector<std::string>{"R", "G", "B"}
                                                         : std::vector<std::string>{"R", "G", "B", "A"};
  int loaded_channels = 0;
  Image image;
  const auto convert = [&](auto* pixels, float scale) {
    using Value = std::remove_pointer_t<decltype(pixels)>;
    const std::unique_ptr<Value, void (*)(void*)> owner(pixels, &stbi_image_free);
    if (pixels == nullptr) throw fail();
    image = Image(width, height, names);
    for (std::size_t i = 0; i < image.data.size(); ++i) image.data[i] = static_cast<float>(pixels[i]) * scale;
  };
  if (stbi_is_16_bit_from_memory(bytes.data(), size) != 0) {
    convert(stbi_load_16_from_memory(bytes.data(), size, &width, &height, &loaded_channels, channels), 1.0f / 65535.0f);
  } else {
    convert(stbi_load_from_memory(bytes.data(), size, &width, &height, &loaded_channels, channels), 1.0f / 255.0f);
  }
  image.metadata["encoding"] = "srgb8";
  return image;
}

std::string image_io::png_bytes(const Image8& image) {
  int size = 0;
  const std::unique_ptr<unsigned char, void (*)(void*)> bytes(
      stbi_write_png_to_mem(image.data.data(), image.width * image.channels, image.width, image.height, image.channels,
                            &size),
      &std::free);
  if (!bytes) throw MemoryError("not enough memory to compress the picture");
  return {reinterpret_cast<const char*>(bytes.get()), static_cast<std::size_t>(size)};
}

std::string image_io::jpeg_bytes(const Image8& image) {
  constexpr int kQuality = 95;
  std::string bytes;
  const auto append = [](void* to, void* data, int size) {
    static_cast<std::string*>(to)->append(static_cast<const char*>(data), static_cast<std::size_t>(size));
  };
  stbi_write_jpg_to_func(append, &bytes, image.width, image.height, image.channels, image.data.data(), kQuality);
  return bytes;
}

}  // namespace octrad
