// Radiance pictures (.hdr): a text header, a resolution line, then scanlines of RGBE pixels, either plain or run-length
// encoded by component; plain ones are written. Format as described in Greg Ward's "Real Pixels" (Graphics Gems II) and
// Radiance's picture-file notes.
#include <algorithm>
#include <cmath>

#include "octrad/base/error.h"
#include "octrad/image/io_internal.h"

namespace octrad {
namespace {

class HdrReader {
 public:
  HdrReader(const std::string& file, const std::string& bytes) : file_(file), bytes_(bytes) {}

  Image read() {
    read_header();
    const auto [width, height] = read_resolution();
    image_io::check_size(file_, width, height, 3);
    // Even runs of 127 need 2 bytes for 127 values of a component: refuse headers that the rest of the file cannot
    // fill.
    if (static_cast<double>(bytes_.size() - at_) * 127.0 <
        static_cast<double>(width) * static_cast<double>(height) * 4.0) {
      throw InputError(file_ + ": truncated HDR file");
    }
    Image image(static_cast<int>(width), static_cast<int>(height), {"R", "G", "B"});
    image.metadata["encoding"] = "linear";
    std::vector<unsigned char> row(static_cast<std::size_t>(width) * 4);
    for (int y = 0; y < image.height; ++y) {
      read_row(row, image.width);
      for (int x = 0; x < image.width; ++x) {
        const unsigned char* p = &row[static_cast<std::size_t>(x) * 4];
        if (p[3] == 0) continue;  // exponent 0: black
        const float scale = std::ldexp(1.0f, p[3] - (128 + 8));
        image.set_rgb(x, y, Vec3f(p[0], p[1], p[2]) * scale);
      }
    }
    return image;
  }

 private:
  unsigned char next() {
    if (at_ >= bytes_.size()) throw InputError(file_ + ": truncated HDR file");
    return static_cast<unsigned char>(bytes_[at_++]);
  }

  std::string line() {
    std::string text;
    for (char c; (c = static_cast<char>(next())) != '\n';) {
      text += c;
      if (text.size() > 4096) throw InputError(file_ + ": broken HDR header (a line of more than 4096 characters)");
    }
    return text;
  }

  void read_header() {
    line();  // "#?RADIANCE" or "#?RGBE": checked by the caller
    for (std::string text = line(); !text.empty(); text = line()) {
      if (text.rfind("FORMAT=", 0) == 0 && text != "FORMAT=32-bit_rle_rgbe") {
        throw InputError(file_ + ": HDR " + text + " is not supported (FORMAT=32-bit_rle_rgbe is)");
      }
    }
  }

  std::pair<long long, long long> read_resolution() {
    const std::string text = line();
    long long height = 0, width = 0;
    char end = 0;
    if (std::sscanf(text.c_str(), "-Y %9lld +X %9lld%c", &height, &width, &end) != 2) {
      throw InputError(file_ + ": HDR resolution \"" + text + "\" is not supported (\"-Y height +X width\" is)");
    }
    return {width, height};
  }

  void read_row(std::vector<unsigned char>& row, int width) {
    unsigned char head[4];
    for (unsigned char& h : head) h = next();
    const bool run_length = width >= 8 && width < 32768 && head[0] == 2 && head[1] == 2 && (head[2] & 0x80) == 0;
    if (!run_length) return read_flat_row(row, width, head);
    if (((head[2] << 8) | head[3]) != width)
      throw InputError(file_ + ": broken HDR scanline (its width differs from the header's)");
    for (std::size_t component = 0; component < 4; ++component) {
      for (int x = 0; x < width;) {
        int count = next();
        const bool run = count > 128;
        if (run) count -= 128;
        if (count == 0 || count > width - x) throw InputError(file_ + ": broken HDR scanline (bad run length)");
        const unsigned char value = run ? next() : static_cast<unsigned char>(0);
        for (int i = 0; i < count; ++i, ++x) row[static_cast<std::size_t>(x) * 4 + component] = run ? value : next();
      }
    }
  }

  // Plain pixels, and the old run-length form: a pixel (1, 1, 1, n) repeats the one before it n times, shifted by 8
  // bits for each such pixel in a row.
  void read_flat_row(std::vector<unsigned char>& row, int width, const unsigned char head[4]) {
    int shift = 0;
    bool first = true;
    for (int x = 0; x < width;) {
      unsigned char p[4];
      for (int c = 0; c < 4; ++c) p[c] = first ? head[c] : next();
      first = false;
      if (p[0] == 1 && p[1] == 1 && p[2] == 1) {
        const long long count = static_cast<long long>(p[3]) << shift;
        if (x == 0 || shift > 16 || count > width - x) throw InputError(file_ + ": broken HDR scanline (bad repeat)");
        for (long long i = 0; i < count; ++i, ++x) {
          for (std::size_t c = 0; c < 4; ++c)
            row[static_cast<std::size_t>(x) * 4 + c] = row[static_cast<std::size_t>(x - 1) * 4 + c];
        }
        shift += 8;
      } else {
        for (std::size_t c = 0; c < 4; ++c) row[static_cast<std::size_t>(x) * 4 + c] = p[c];
        ++x;
        shift = 0;
      }
    }
  }

  const std::string& file_;
  const std::string& bytes_;
  std::size_t at_ = 0;
};

}  // namespace

Image image_io::read_hdr(const std::string& file, const std::string& bytes) { return HdrReader(file, bytes).read(); }

std::string image_io::hdr_bytes(const Image& rgb) {
  // Plain pixels. None can be taken for a run: the largest mantissa of each is at least 128, or all are 0.
  std::string out = "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y " + std::to_string(rgb.height) + " +X " +
                    std::to_string(rgb.width) + "\n";
  constexpr float kLargest = 0x0.ffp127f;  // of what a byte and an exponent hold
  for (int y = 0; y < rgb.height; ++y) {
    for (int x = 0; x < rgb.width; ++x) {
      Vec3f v = rgb.rgb(x, y);
      for (int c = 0; c < 3; ++c) v[c] = v[c] > 0.0f ? std::min(v[c], kLargest) : 0.0f;  // not a number: 0
      int exponent = 0;
      std::frexp(max_component(v), &exponent);
      if (std::lround(std::ldexp(max_component(v), 8 - exponent)) > 255) ++exponent;
      const bool black = max_component(v) == 0.0f || exponent + 128 <= 0;
      for (int c = 0; c < 3; ++c) out += static_cast<char>(black ? 0 : std::lround(std::ldexp(v[c], 8 - exponent)));
      out += static_cast<char>(black ? 0 : exponent + 128);
    }
  }
  return out;
}

}  // namespace octrad
