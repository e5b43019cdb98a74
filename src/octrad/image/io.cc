#include "octrad/image/io.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>

#include "octrad/base/atomic_file.h"
#include "octrad/base/error.h"
#include "octrad/base/input_file.h"
#include "octrad/base/lower_case.h"
#include "octrad/base/memory_limit.h"
#include "octrad/image/encode.h"
#include "octrad/image/io_internal.h"
#include "octrad/image/size_limit.h"

namespace octrad {
namespace image_io {

namespace {
constexpr long long kMaxValues = 1LL << 33;  // 32 GiB of floats
}  // namespace

void check_size(const std::string& file, long long width, long long height, long long channels, std::uint64_t beside) {
  const auto text = [&] {
    return fmt::format("{}: picture of {} x {} pixels and {} channels", file, width, height, channels);
  };
  if (width <= 0 || height <= 0 || channels <= 0) throw InputError(text());
  if (width > kMostFilmPixels || height > kMostFilmPixels || channels > kMaxValues ||
      width * height > kMaxValues / channels)
    throw InputError(
        fmt::format("{} is too large (at most {} pixels a side and 32 GiB in memory)", text(), kMostFilmPixels));
  ask_memory(static_cast<std::uint64_t>(width * height * channels) * sizeof(float) + beside, text());
}

}  // namespace image_io

Image parse_image(const std::string& file, const std::string& bytes) {
  if (bytes.starts_with("\x76\x2f\x31\x01")) return image_io::read_exr(file, bytes);
  if (bytes.starts_with("\x89PNG\r\n\x1a\n")) return image_io::read_png(file, bytes);
  if (bytes.starts_with("\xff\xd8\xff")) return image_io::read_jpeg(file, bytes);
  if (is_webp(bytes)) return image_io::read_webp(file, bytes);
  if (bytes.starts_with("#?")) return image_io::read_hdr(file, bytes);
  if (bytes.starts_with("PF") || bytes.starts_with("Pf")) return image_io::read_pfm(file, bytes);
  if (bytes.starts_with("BM")) return image_io::read_bmp(file, bytes);
  if (ending_of(file) == ".tga" || bytes.ends_with(std::string_view("TRUEVISION-XFILE.\0", 18)))
    return image_io::read_tga(file, bytes);
  throw InputError(file + ": not a picture that can be read (EXR, PNG, JPEG, HDR, PFM, BMP, TGA and WebP can)");
}

Image read_image(const std::string& file) {
  const MemoryScope scope;
  return parse_image(file, read_file(file));
}

bool is_picture_name(const std::string& file) {
  static const char* const kEndings[] = {".exr", ".hdr", ".pfm", ".png", ".jpg", ".jpeg", ".webp", ".bmp", ".tga"};
  const std::string ending = ending_of(file);
  return std::find(std::begin(kEndings), std::end(kEndings), ending) != std::end(kEndings);
}

PictureFormat picture_format(const std::string& file) {
  const std::string ending = ending_of(file);
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

void require_format_size(const std::string& file, int width, int height) {
  constexpr int kMostOfJpeg = 65500;
  if (picture_format(file) != PictureFormat::jpeg || std::max(width, height) <= kMostOfJpeg) return;
  throw UsageError(
      fmt::format("{}: JPEG has at most {} pixels a side, and the picture is of {} x {}; take .png or .exr", file,
                  kMostOfJpeg, width, height));
}

void write_image(const std::string& file, const Image& image, const ToneMapping& mapping, const ExrSettings& exr) {
  if (picture_format(file) == PictureFormat::exr) require_writable(file);
  write_file(file, encode_image(file, image, mapping, exr));
}

void write_image(const std::string& file, const Image8& image) {
  const PictureFormat format = picture_format(file);
  if (!is_display_format(format)) throw UsageError(file + ": a picture for the screen is written as .png or .jpg");
  write_file(file, format == PictureFormat::png ? image_io::png_bytes(image) : image_io::jpeg_bytes(image));
}

}  // namespace octrad
