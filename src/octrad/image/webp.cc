// WebP, as glTF files have it, through libwebp. 8 bits a channel; animations are refused.
#include <webp/decode.h>

#include <algorithm>
#include <mutex>

#include "octrad/base/error.h"
#include "octrad/image/io_internal.h"

namespace octrad {
namespace {

// Lossless pictures, and the alpha of others, may have tables of codes of their own for each 4 x 4 pixels, 65536 in
// all, which take 20 bits or more in the file and up to 10 kB in memory (libwebp 1.2).
std::uint64_t table_bytes(const WebPBitstreamFeatures& features, std::uint64_t file_bytes) {
  constexpr int kLossy = 1;
  if (features.format == kLossy && !features.has_alpha) return 0;
  const auto tiles = [](int pixels) { return (static_cast<std::uint64_t>(pixels) + 3) / 4; };
  return 10'000 * std::min({std::uint64_t{65536}, tiles(features.width) * tiles(features.height), file_bytes * 8 / 20});
}

}  // namespace

bool is_webp(const std::string& bytes) {
  return bytes.starts_with("RIFF") && bytes.size() >= 12 && bytes.compare(8, 4, "WEBP") == 0;
}

Image image_io::read_webp(const std::string& file, const std::string& bytes) {
  const auto fail = [&] { throw InputError(file + ": broken or truncated WebP file"); };
  const auto* data = reinterpret_cast<const std::uint8_t*>(bytes.data());
  WebPDecoderConfig config;
  if (!WebPInitDecoderConfig(&config) || WebPGetFeatures(data, bytes.size(), &config.input) != VP8_STATUS_OK) fail();
  const int width = config.input.width, height = config.input.height;
  if (config.input.has_animation) throw InputError(file + ": animated WebP is not supported");
  std::vector<std::string> names{"R", "G", "B"};
  if (config.input.has_alpha) names.push_back("A");
  const auto pixels = static_cast<std::uint64_t>(width) * static_cast<std::uint64_t>(height), channels = names.size();
  // So that many threads do not ask for tables that no usual picture has.
  const std::uint64_t tables = table_bytes(config.input, bytes.size());
  static std::mutex one_at_a_time;
  std::unique_lock lock(one_at_a_time, std::defer_lock);
  if (tables > 0) lock.lock();
  check_size(file, width, height, static_cast<long long>(channels), pixels * (4 + channels) + tables);
  std::vector<std::uint8_t> values(pixels * channels);
  config.output.colorspace = channels == 4 ? MODE_RGBA : MODE_RGB;
  config.output.is_external_memory = 1;
  config.output.u.RGBA = {values.data(), width * static_cast<int>(channels), values.size()};
  const VP8StatusCode status = WebPDecode(data, bytes.size(), &config);
  if (status == VP8_STATUS_OUT_OF_MEMORY) throw MemoryError(file + ": not enough memory to decode the picture");
  if (status != VP8_STATUS_OK) fail();
  Image image(width, height, std::move(names));
  for (std::size_t i = 0; i < values.size(); ++i) image.data[i] = static_cast<float>(values[i]) * (1.0f / 255.0f);
  image.metadata["encoding"] = "srgb8";
  return image;
}

}  // namespace octrad
