#include "octrad/image/io.h"

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>

#include "octrad/base/error.h"
#include "octrad/image/io_internal.h"

namespace octrad {
namespace image_io {

namespace {
constexpr long long kMaxSide = 131072;
constexpr long long kMaxValues = 1LL << 30;  // 4 GiB of floats
}  // namespace

void check_size(const std::string& file, long long width, long long height, long long channels) {
  if (width <= 0 || height <= 0 || channels <= 0) {
    throw InputError(file + ": picture of " + std::to_string(width) + " x " + std::to_string(height) + " pixels and " +
                     std::to_string(channels) + " channels");
  }
  if (width > kMaxSide || height > kMaxSide || channels > kMaxValues || width * height > kMaxValues / channels) {
    throw InputError(file + ": picture of " + std::to_string(width) + " x " + std::to_string(height) + " pixels and " +
                     std::to_string(channels) + " channels is too large (at most " + std::to_string(kMaxSide) +
                     " pixels a side and 4 GiB in memory)");
  }
}

}  // namespace image_io

namespace {

bool starts_with(const std::vector<unsigned char>& bytes, std::initializer_list<unsigned char> magic) {
  return bytes.size() >= magic.size() && std::equal(magic.begin(), magic.end(), bytes.begin());
}

}  // namespace

Image read_image(const std::string& file) {
  std::error_code failed;
  if (std::filesystem::is_directory(file, failed)) throw IoError(file + ": is a folder, not a picture");
  std::ifstream stream(file, std::ios::binary);
  if (!stream) throw IoError(file + ": cannot open: " + std::strerror(errno));
  std::vector<unsigned char> bytes(16);
  stream.read(reinterpret_cast<char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
  bytes.resize(static_cast<std::size_t>(stream.gcount()));
  if (starts_with(bytes, {0x76, 0x2f, 0x31, 0x01})) return image_io::read_exr(file);
  const bool png = starts_with(bytes, {0x89, 'P', 'N', 'G', '\r', '\n', 0x1a, '\n'});
  const bool jpeg = starts_with(bytes, {0xff, 0xd8, 0xff});
  const bool hdr = starts_with(bytes, {'#', '?'});
  if (!png && !jpeg && !hdr) throw InputError(file + ": not a picture that can be read (EXR, PNG, JPEG and HDR can)");

  stream.clear();
  stream.seekg(0, std::ios::end);
  const std::streamoff size = stream.tellg();
  stream.seekg(0);
  if (size < 0) throw IoError(file + ": cannot be read as a file");
  if (size > 0x7fffffff) throw InputError(file + ": larger than 2 GiB");
  bytes.resize(static_cast<std::size_t>(size));
  if (!stream.read(reinterpret_cast<char*>(bytes.data()), size))
    throw IoError(file + ": cannot read: " + std::strerror(errno));
  return hdr ? image_io::read_hdr(file, bytes) : image_io::read_stb(file, bytes);
}

}  // namespace octrad
