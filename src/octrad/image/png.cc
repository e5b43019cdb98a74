// PNG through libpng. Its errors are jumps (setjmp): between a jump and its target only plain C data may live, which is
// why every call of the library stands in a function whose objects belong to its caller.
#include <png.h>

#include <bit>
#include <csetjmp>
#include <cstring>

#include "octrad/base/error.h"
#include "octrad/image/io_internal.h"

namespace octrad {
namespace {

struct Reason {
  char text[160] = "";
};

[[noreturn]] void on_error(png_structp png, png_const_charp message) {
  auto* reason = static_cast<Reason*>(png_get_error_ptr(png));
  std::strncpy(reason->text, message, sizeof(reason->text) - 1);
  png_longjmp(png, 1);
}

void on_warning(png_structp, png_const_charp) {}

struct Source {
  const unsigned char* data;
  std::size_t size, at = 0;
};

void on_read(png_structp png, png_bytep to, std::size_t count) {
  auto* source = static_cast<Source*>(png_get_io_ptr(png));
  if (count > source->size - source->at) png_error(png, "truncated PNG file");
  std::memcpy(to, source->data + source->at, count);
  source->at += count;
}

class PngReader {
 public:
  explicit PngReader(Source source) : source_(source) {
    png_ = png_create_read_struct(PNG_LIBPNG_VER_STRING, &reason_, on_error, on_warning);
    if (png_ != nullptr) info_ = png_create_info_struct(png_);
    if (info_ == nullptr) throw MemoryError("not enough memory to read a PNG file");
    png_set_read_fn(png_, &source_, on_read);
    png_set_user_limits(png_, 0x7fffffff, 0x7fffffff);  // check_size() knows the limits
    // Chunks that the picture does not need are passed over: libpng would allocate what some of them say is their
    // length.
    png_set_keep_unknown_chunks(png_, PNG_HANDLE_CHUNK_NEVER, nullptr, -1);
  }
  ~PngReader() { png_destroy_read_struct(&png_, &info_, nullptr); }
  PngReader(const PngReader&) = delete;
  PngReader& operator=(const PngReader&) = delete;

  // The layout is that after what the reader makes of it: 8 or 16 bits, grey or RGB, each with or without alpha;
  // palettes, fewer bits and transparent colours are expanded, and what is said of gamma and colour spaces is not
  // looked at.
  bool read_header() {
    if (setjmp(png_jmpbuf(png_))) return false;
    png_read_info(png_, info_);
    return true;
  }
  // Before the first row: allocates rows, whose size has to be checked before.
  bool start() {
    if (setjmp(png_jmpbuf(png_))) return false;
    png_set_expand(png_);
    if constexpr (std::endian::native == std::endian::little) png_set_swap(png_);
    png_set_interlace_handling(png_);
    png_read_update_info(png_, info_);
    return png_get_channels(png_, info_) == channels() && png_get_rowbytes(png_, info_) == row_bytes();
  }
  bool read_row(unsigned char* row) {
    if (setjmp(png_jmpbuf(png_))) return false;
    png_read_row(png_, row, nullptr);
    return true;
  }
  bool read_rows(unsigned char** rows) {
    if (setjmp(png_jmpbuf(png_))) return false;
    png_read_image(png_, rows);
    return true;
  }
  bool read_end() {
    if (setjmp(png_jmpbuf(png_))) return false;
    png_read_end(png_, nullptr);
    return true;
  }

  long long width() const { return png_get_image_width(png_, info_); }
  long long height() const { return png_get_image_height(png_, info_); }
  int channels() const {
    const int type = png_get_color_type(png_, info_);
    const bool alpha = (type & PNG_COLOR_MASK_ALPHA) != 0 || png_get_valid(png_, info_, PNG_INFO_tRNS) != 0;
    return ((type & PNG_COLOR_MASK_COLOR) != 0 ? 3 : 1) + (alpha ? 1 : 0);
  }
  int bytes_per_value() const { return png_get_bit_depth(png_, info_) == 16 ? 2 : 1; }
  std::size_t row_bytes() const { return static_cast<std::size_t>(width() * channels() * bytes_per_value()); }
  bool interlaced() const { return png_get_interlace_type(png_, info_) != PNG_INTERLACE_NONE; }
  const char* reason() const { return reason_.text; }

 private:
  Source source_;
  Reason reason_;
  png_structp png_ = nullptr;
  png_infop info_ = nullptr;
};

void convert_row(const unsigned char* row, std::size_t values, int bytes_per_value, float* out) {
  if (bytes_per_value == 1) {
    for (std::size_t i = 0; i < values; ++i) out[i] = static_cast<float>(row[i]) * (1.0f / 255.0f);
    return;
  }
  for (std::size_t i = 0; i < values; ++i) {
    std::uint16_t v = 0;
    std::memcpy(&v, row + 2 * i, 2);
    out[i] = static_cast<float>(v) * (1.0f / 65535.0f);
  }
}

void on_write(png_structp png, png_bytep data, std::size_t count) {
  static_cast<std::string*>(png_get_io_ptr(png))->append(reinterpret_cast<const char*>(data), count);
}
void on_flush(png_structp) {}

bool write_png(png_structp png, png_infop info, const Image8& image, int color) {
  if (setjmp(png_jmpbuf(png))) return false;
  png_set_IHDR(png, info, static_cast<png_uint_32>(image.width), static_cast<png_uint_32>(image.height), 8, color,
               PNG_INTERLACE_NONE, PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
  png_write_info(png, info);
  const std::size_t row = static_cast<std::size_t>(image.width) * static_cast<std::size_t>(image.channels);
  for (int y = 0; y < image.height; ++y) png_write_row(png, image.data.data() + static_cast<std::size_t>(y) * row);
  png_write_end(png, nullptr);
  return true;
}

}  // namespace

Image image_io::read_png(const std::string& file, const std::string& bytes) {
  PngReader png({reinterpret_cast<const unsigned char*>(bytes.data()), bytes.size()});
  const auto fail = [&] { throw InputError(file + ": broken picture: " + png.reason()); };
  if (!png.read_header()) fail();
  const int channels = png.channels();
  const std::size_t row_bytes = png.row_bytes();
  check_size(file, png.width(), png.height(), channels,
             png.interlaced() ? row_bytes * static_cast<std::size_t>(png.height()) : row_bytes);
  // Deflate gains at most a factor of 1032, of pixels of one bit at least.
  if (static_cast<double>(bytes.size()) * 1032.0 * 8.0 <
      static_cast<double>(png.width()) * static_cast<double>(png.height()))
    throw InputError(file + ": truncated PNG file");
  if (!png.start()) fail();

  static const std::vector<std::string> kNames[] = {{"Y"}, {"Y", "A"}, {"R", "G", "B"}, {"R", "G", "B", "A"}};
  Image image(static_cast<int>(png.width()), static_cast<int>(png.height()), kNames[channels - 1]);
  const std::size_t values = static_cast<std::size_t>(image.width) * static_cast<std::size_t>(channels);
  const auto height = static_cast<std::size_t>(image.height);
  const auto convert = [&](const unsigned char* row, std::size_t y) {
    convert_row(row, values, png.bytes_per_value(), image.data.data() + y * values);
  };
  if (png.interlaced()) {
    std::vector<unsigned char> pixels(row_bytes * height);
    std::vector<unsigned char*> rows(height);
    for (std::size_t y = 0; y < height; ++y) rows[y] = pixels.data() + y * row_bytes;
    if (!png.read_rows(rows.data())) fail();
    for (std::size_t y = 0; y < height; ++y) convert(rows[y], y);
  } else {
    std::vector<unsigned char> row(row_bytes);
    for (std::size_t y = 0; y < height; ++y) {
      if (!png.read_row(row.data())) fail();
      convert(row.data(), y);
    }
  }
  if (!png.read_end()) fail();
  image.metadata["encoding"] = "srgb8";
  return image;
}

std::string image_io::png_bytes(const Image8& image) {
  static constexpr int kColors[] = {PNG_COLOR_TYPE_GRAY, PNG_COLOR_TYPE_GRAY_ALPHA, PNG_COLOR_TYPE_RGB,
                                    PNG_COLOR_TYPE_RGB_ALPHA};
  std::string bytes;
  Reason reason;
  png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, &reason, on_error, on_warning);
  png_infop info = png != nullptr ? png_create_info_struct(png) : nullptr;
  if (info == nullptr) {
    png_destroy_write_struct(&png, nullptr);
    throw MemoryError("not enough memory to write a PNG file");
  }
  png_set_write_fn(png, &bytes, on_write, on_flush);
  const bool written = write_png(png, info, image, kColors[image.channels - 1]);
  png_destroy_write_struct(&png, &info);
  if (!written) throw InputError(std::string("the picture cannot be written as PNG: ") + reason.text);
  return bytes;
}

}  // namespace octrad
