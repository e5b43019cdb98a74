#include "octrad/image/io.h"

#include <algorithm>
#include <cctype>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>

#include "octrad/base/atomic_file.h"
#include "octrad/base/error.h"
#include "octrad/image/io_internal.h"
#include "octrad/image/tonemap.h"

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

void write_bytes(const std::string& file, const std::string& bytes) {
  AtomicFile out(file);
  out.write(bytes);
  out.commit();
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
  const bool pfm = starts_with(bytes, {'P', 'F'}) || starts_with(bytes, {'P', 'f'});
  if (!png && !jpeg && !hdr && !pfm)
    throw InputError(file + ": not a picture that can be read (EXR, PNG, JPEG, HDR and PFM can)");

  stream.clear();
  stream.seekg(0, std::ios::end);
  const std::streamoff size = stream.tellg();
  stream.seekg(0);
  if (size < 0) throw IoError(file + ": cannot be read as a file");
  if (size > 0x7fffffff) throw InputError(file + ": larger than 2 GiB");
  bytes.resize(static_cast<std::size_t>(size));
  if (!stream.read(reinterpret_cast<char*>(bytes.data()), size))
    throw IoError(file + ": cannot read: " + std::strerror(errno));
  if (hdr) return image_io::read_hdr(file, bytes);
  return pfm ? image_io::read_pfm(file, bytes) : image_io::read_stb(file, bytes);
}

PictureFormat picture_format(const std::string& file) {
  std::string ending = std::filesystem::path(file).extension().string();
  std::transform(ending.begin(), ending.end(), ending.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  if (ending == ".exr") return PictureFormat::exr;
  if (ending == ".hdr") return PictureFormat::hdr;
  if (ending == ".pfm") return PictureFormat::pfm;
  if (ending == ".png") return PictureFormat::png;
  if (ending == ".jpg" || ending == ".jpeg") return PictureFormat::jpeg;
  std::error_code failed;
  if (std::filesystem::is_character_file(file, failed)) return PictureFormat::exr;
  throw UsageError(
      file + ": the ending says what is written: .exr, .hdr or .pfm (linear radiance), .png or .jpg (for the screen)");
}

void write_image(const std::string& file, const Image& image, const ToneMapping& mapping) {
  const PictureFormat format = picture_format(file);
  if (format == PictureFormat::exr) return write_exr(file, image);
  if (is_display_format(format)) return write_image(file, tonemap(image, mapping));
  const Image rgb = extract_rgb(image);
  write_bytes(file, format == PictureFormat::hdr ? image_io::hdr_bytes(rgb) : image_io::pfm_bytes(rgb));
}

void write_image(const std::string& file, const Image8& image) {
  const PictureFormat format = picture_format(file);
  if (!is_display_format(format)) throw UsageError(file + ": a picture for the screen is written as .png or .jpg");
  write_bytes(file, format == PictureFormat::png ? image_io::png_bytes(image) : image_io::jpeg_bytes(image));
}

}  // namespace octrad
