// Portable float maps (.pfm): a header of three lines ("PF" for colour or "Pf" for grey, width and height, a scale
// whose sign is the byte order), then rows of floats from the bottom to the top. Format as Paul Debevec's HDR Shop
// wrote it.
#include <bit>
#include <cmath>
#include <cstring>
#include <sstream>

#include "octrad/base/error.h"
#include "octrad/image/io_internal.h"

namespace octrad {
namespace {

static_assert(std::endian::native == std::endian::little);

float swapped(float value) { return std::bit_cast<float>(__builtin_bswap32(std::bit_cast<unsigned>(value))); }

}  // namespace

Image image_io::read_pfm(const std::string& file, const std::string& bytes) {
  constexpr std::size_t kLongestHeader = 256;
  std::istringstream header(bytes.substr(0, kLongestHeader));
  std::string magic;
  long long width = 0, height = 0;
  double scale = 0.0;
  header >> magic >> width >> height >> scale;
  if (!header || (magic != "PF" && magic != "Pf") || scale == 0.0 || !std::isfinite(scale) ||
      !std::isspace(header.get()))
    throw InputError(file + ": broken PFM header (expected PF or Pf, width, height and a scale)");
  const std::vector<std::string> names =
      magic == "PF" ? std::vector<std::string>{"R", "G", "B"} : std::vector<std::string>{"Y"};
  check_size(file, width, height, static_cast<long long>(names.size()));
  const auto start = static_cast<std::size_t>(header.tellg());
  const std::size_t row = static_cast<std::size_t>(width) * names.size();
  if ((bytes.size() - start) / sizeof(float) / row < static_cast<std::size_t>(height))
    throw InputError(file + ": truncated PFM file");
  Image image(static_cast<int>(width), static_cast<int>(height), names);
  image.metadata["encoding"] = "linear";
  for (std::size_t y = 0, rows = static_cast<std::size_t>(height); y < rows; ++y)
    std::memcpy(&image.data[(rows - 1 - y) * row], &bytes[start + y * row * sizeof(float)], row * sizeof(float));
  if (scale > 0.0) {  // big-endian
    for (float& v : image.data) v = swapped(v);
  }
  if (const auto factor = static_cast<float>(std::fabs(scale)); factor != 1.0f) {
    for (float& v : image.data) v *= factor;
  }
  return image;
}

std::string image_io::pfm_bytes(const Image& rgb) {
  std::string out = "PF\n" + std::to_string(rgb.width) + " " + std::to_string(rgb.height) + "\n-1.0\n";
  const std::size_t row = static_cast<std::size_t>(rgb.width) * 3;
  for (std::size_t y = static_cast<std::size_t>(rgb.height); y-- > 0;)
    out.append(reinterpret_cast<const char*>(&rgb.data[y * row]), row * sizeof(float));
  return out;
}

}  // namespace octrad
