// JPEG through libjpeg (libjpeg-turbo). Its errors are jumps (setjmp): between a jump and its target only plain C data
// may live, which is why every call of the library stands in a function whose objects belong to its caller.
#include <algorithm>
#include <csetjmp>
#include <cstdio>
// After <cstdio>, which they need and do not include.
#include <jerror.h>
#include <jpeglib.h>

#include "octrad/base/error.h"
#include "octrad/image/io_internal.h"

namespace octrad {
namespace {

// Of a progressive picture: each scan takes as much time as a whole one, and a few bytes.
constexpr int kMostScans = 500;
constexpr double kMostScanned = 0x1p33;  // pixels, once for each scan

struct Errors {
  jpeg_error_mgr base;  // first: the library knows this part
  std::jmp_buf jump;
  char text[JMSG_LENGTH_MAX] = "";
};

[[noreturn]] void on_error(j_common_ptr jpeg) {
  auto* errors = reinterpret_cast<Errors*>(jpeg->err);
  errors->base.format_message(jpeg, errors->text);
  std::longjmp(errors->jump, 1);
}

// The library goes on with grey where data are missing or wrong, and warns: a picture with holes is none.
void on_message(j_common_ptr jpeg, int level) {
  if (level >= 0) return;
  switch (jpeg->err->msg_code) {
    case JWRN_EXTRANEOUS_DATA:
    case JWRN_JFIF_MAJOR:
    case JWRN_ADOBE_XFORM:
    case JWRN_NOT_SEQUENTIAL: return;  // some writers leave 0 where a scan says which of its numbers are kept
    default: on_error(jpeg);
  }
}

void on_progress(j_common_ptr jpeg) {
  const auto* picture = reinterpret_cast<j_decompress_ptr>(jpeg);
  const int most = static_cast<int>(
      std::min<double>(kMostScans, kMostScanned / (static_cast<double>(picture->image_width) * picture->image_height)));
  if (picture->input_scan_number <= std::max(most, 1)) return;
  auto* errors = reinterpret_cast<Errors*>(jpeg->err);
  std::snprintf(errors->text, sizeof(errors->text), "more than %d scans", most);
  std::longjmp(errors->jump, 1);
}

void set_errors(Errors& errors) {
  jpeg_std_error(&errors.base);
  errors.base.error_exit = on_error;
  errors.base.emit_message = on_message;
}

class JpegReader {
 public:
  JpegReader() {
    set_errors(errors_);
    jpeg_.err = &errors_.base;
    progress_.progress_monitor = on_progress;
  }
  ~JpegReader() { jpeg_destroy_decompress(&jpeg_); }
  JpegReader(const JpegReader&) = delete;
  JpegReader& operator=(const JpegReader&) = delete;

  bool read_header(const std::string& bytes) {
    if (setjmp(errors_.jump)) return false;
    jpeg_create_decompress(&jpeg_);
    jpeg_.progress = &progress_;
    jpeg_mem_src(&jpeg_, reinterpret_cast<const unsigned char*>(bytes.data()), bytes.size());
    jpeg_read_header(&jpeg_, TRUE);
    // Four inks are turned into colours in convert_row(); whatever else is not grey becomes RGB or an error.
    jpeg_.out_color_space = inks() ? JCS_CMYK : jpeg_.num_components == 1 ? JCS_GRAYSCALE : JCS_RGB;
    jpeg_calc_output_dimensions(&jpeg_);
    return true;
  }
  bool start() {
    if (setjmp(errors_.jump)) return false;
    jpeg_start_decompress(&jpeg_);
    return true;
  }
  bool read_row(unsigned char* row) {
    if (setjmp(errors_.jump)) return false;
    jpeg_read_scanlines(&jpeg_, &row, 1);
    return true;
  }
  bool finish() {
    if (setjmp(errors_.jump)) return false;
    jpeg_finish_decompress(&jpeg_);
    return true;
  }

  bool inks() const { return jpeg_.num_components == 4; }
  bool adobe() const { return jpeg_.saw_Adobe_marker != FALSE; }
  int channels() const { return jpeg_.num_components == 1 ? 1 : 3; }
  long long width() const { return jpeg_.output_width; }
  long long height() const { return jpeg_.output_height; }
  // Coefficients that the library keeps of pictures whose scans are not complete in themselves.
  std::uint64_t coefficient_bytes() {
    const bool whole = jpeg_.progressive_mode != FALSE || jpeg_has_multiple_scans(&jpeg_) != FALSE;
    return whole ? static_cast<std::uint64_t>(width() * height() * jpeg_.num_components) * 2 : 0;
  }
  bool arithmetic() const { return jpeg_.arith_code != FALSE; }
  const char* reason() const { return errors_.text; }

 private:
  jpeg_decompress_struct jpeg_{};
  jpeg_progress_mgr progress_{};
  Errors errors_;
};

struct Output {
  unsigned char* data = nullptr;
  unsigned long size = 0;
  ~Output() { std::free(data); }
};

bool write_jpeg(jpeg_compress_struct& jpeg, Errors& errors, const Image8& image, Output& out, int quality) {
  if (setjmp(errors.jump)) return false;
  jpeg_create_compress(&jpeg);
  jpeg_mem_dest(&jpeg, &out.data, &out.size);
  jpeg.image_width = static_cast<JDIMENSION>(image.width);
  jpeg.image_height = static_cast<JDIMENSION>(image.height);
  jpeg.input_components = image.channels;
  jpeg.in_color_space = image.channels == 1 ? JCS_GRAYSCALE : JCS_RGB;
  jpeg_set_defaults(&jpeg);
  jpeg_set_quality(&jpeg, quality, TRUE);
  for (int c = 0; c < jpeg.num_components; ++c)  // colours at full resolution
    jpeg.comp_info[c].h_samp_factor = jpeg.comp_info[c].v_samp_factor = 1;
  jpeg_start_compress(&jpeg, TRUE);
  const std::size_t row = static_cast<std::size_t>(image.width) * static_cast<std::size_t>(image.channels);
  while (jpeg.next_scanline < jpeg.image_height) {
    auto* line = const_cast<JSAMPROW>(image.data.data() + jpeg.next_scanline * row);
    jpeg_write_scanlines(&jpeg, &line, 1);
  }
  jpeg_finish_compress(&jpeg);
  return true;
}

}  // namespace

Image image_io::read_jpeg(const std::string& file, const std::string& bytes) {
  JpegReader jpeg;
  const auto fail = [&] { throw InputError(file + ": broken or truncated JPEG file: " + jpeg.reason()); };
  if (!jpeg.read_header(bytes)) fail();
  const long long width = jpeg.width(), height = jpeg.height();
  check_size(file, width, height, jpeg.channels(), jpeg.coefficient_bytes());
  // A block of 8 x 8 pixels takes at least a bit.
  if (!jpeg.arithmetic() &&
      static_cast<double>(bytes.size()) * 1024.0 < static_cast<double>(width) * static_cast<double>(height))
    throw InputError(file + ": truncated JPEG file");
  const bool inks = jpeg.inks(), inverted = jpeg.adobe();
  Image image(static_cast<int>(width), static_cast<int>(height),
              jpeg.channels() == 1 ? std::vector<std::string>{"Y"} : std::vector<std::string>{"R", "G", "B"});
  const auto pixels = static_cast<std::size_t>(width);
  std::vector<unsigned char> row(pixels * (inks ? 4 : image.channels.size()));
  if (!jpeg.start()) fail();
  float* out = image.data.data();
  for (long long y = 0; y < height; ++y) {
    if (!jpeg.read_row(row.data())) fail();
    if (inks) {
      // Adobe stores inks inverted: what is left of the light.
      for (std::size_t i = 0; i < pixels; ++i) {
        const auto light = [&](std::size_t c) {
          const int v = row[4 * i + c];
          return static_cast<float>(inverted ? v : 255 - v) * (1.0f / 255.0f);
        };
        for (std::size_t c = 0; c < 3; ++c) *out++ = light(c) * light(3);
      }
    } else {
      for (const unsigned char v : row) *out++ = static_cast<float>(v) * (1.0f / 255.0f);
    }
  }
  if (!jpeg.finish()) fail();
  image.metadata["encoding"] = "srgb8";
  return image;
}

std::string image_io::jpeg_bytes(const Image8& image, int quality) {
  jpeg_compress_struct jpeg{};
  Errors errors;
  set_errors(errors);
  jpeg.err = &errors.base;
  Output out;
  const bool written = write_jpeg(jpeg, errors, image, out, quality);
  jpeg_destroy_compress(&jpeg);
  if (!written) throw InputError(std::string("the picture cannot be written as JPEG: ") + errors.text);
  return {reinterpret_cast<const char*>(out.data), out.size};
}

}  // namespace octrad
