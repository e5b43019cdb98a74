// Truevision TGA pictures: grey, true colour and with a palette, plain or run-length encoded, as the specification of
// version 2.0 describes them. The format has no signature: files are known by their names.
#include <vector>

#include "octrad/base/error.h"
#include "octrad/image/io_internal.h"

namespace octrad {
namespace {

class TgaReader {
 public:
  TgaReader(const std::string& file, const std::string& bytes) : file_(file), bytes_(bytes) {}

  Image read() {
    const int id = next(), map_type = next(), kind = next();
    const int map_first = next16(), map_length = next16(), map_depth = next();
    next16();  // the picture's place on a screen
    next16();
    const int width = next16(), height = next16(), depth = next(), descriptor = next();
    const int type = kind & 7;
    if (kind > 11 || (kind & ~11) != 0 || type < 1 || type > 3)
      throw InputError(file_ + ": TGA of type " + std::to_string(kind) + "; 1, 2, 3, 9, 10 and 11 are supported");
    if (type == 1   ? depth != 8 || map_type != 1
        : type == 3 ? depth != 8 && depth != 16
                    : depth != 15 && depth != 16 && depth != 24 && depth != 32)
      throw InputError(file_ + ": TGA of " + std::to_string(depth) + " bits a pixel is not supported");
    image_io::check_size(file_, width, height, type == 3 ? 1 : 3);
    at_ += static_cast<std::size_t>(id);
    std::vector<Vec3f> map;
    if (map_type == 1) {
      if (map_depth != 15 && map_depth != 16 && map_depth != 24 && map_depth != 32)
        throw InputError(file_ + ": TGA palette of " + std::to_string(map_depth) + " bits is not supported");
      for (int i = 0; i < map_length; ++i) map.push_back(color(map_depth));
    }
    const std::vector<std::string> names =
        type == 3 ? std::vector<std::string>{"Y"} : std::vector<std::string>{"R", "G", "B"};
    // A run takes at least two bytes for 128 pixels: a header that the rest cannot fill is refused.
    const double left = static_cast<double>(bytes_.size() - std::min(at_, bytes_.size()));
    if (left * ((kind & 8) != 0 ? 64.0 : 1.0) < static_cast<double>(width) * height) truncated();
    Image image(width, height, names);
    image.metadata["encoding"] = "srgb8";
    const bool down = (descriptor & 0x20) != 0, left_to_right = (descriptor & 0x10) == 0;
    int left_in_packet = 0;
    bool run = false;
    Vec3f pixel;
    for (int i = 0; i < height; ++i) {
      for (int j = 0; j < width; ++j) {
        bool fresh = true;
        if ((kind & 8) != 0) {
          if (left_in_packet == 0) {
            const int head = next();
            run = (head & 0x80) != 0;
            left_in_packet = (head & 0x7f) + 1;
          } else {
            fresh = !run;
          }
          --left_in_packet;
        }
        if (fresh) pixel = read_pixel(type, depth, map, map_first);
        const int x = left_to_right ? j : width - 1 - j, y = down ? i : height - 1 - i;
        if (type == 3) {
          image.at(x, y, 0) = pixel.x;
        } else {
          image.set_rgb(x, y, pixel);
        }
      }
    }
    return image;
  }

 private:
  [[noreturn]] void truncated() const { throw InputError(file_ + ": truncated TGA file"); }
  int next() {
    if (at_ >= bytes_.size()) truncated();
    return static_cast<unsigned char>(bytes_[at_++]);
  }
  int next16() {
    const int low = next();
    return low | next() << 8;
  }
  Vec3f color(int depth) {
    if (depth <= 16) {
      const int v = next16();
      return Vec3f(static_cast<float>(v >> 10 & 31), static_cast<float>(v >> 5 & 31), static_cast<float>(v & 31)) /
             31.0f;
    }
    const auto b = static_cast<float>(next()), g = static_cast<float>(next()), r = static_cast<float>(next());
    if (depth == 32) next();  // alpha is not used
    return Vec3f(r, g, b) / 255.0f;
  }
  Vec3f read_pixel(int type, int depth, const std::vector<Vec3f>& map, int first) {
    if (type == 2) return color(depth);
    const int value = next();
    if (depth == 16) next();  // grey with alpha, which is not used
    if (type == 3) return Vec3f(static_cast<float>(value) / 255.0f);
    const int index = value - first;
    if (index < 0 || static_cast<std::size_t>(index) >= map.size())
      throw InputError(file_ + ": broken TGA file (a pixel outside of the palette)");
    return map[static_cast<std::size_t>(index)];
  }

  const std::string& file_;
  const std::string& bytes_;
  std::size_t at_ = 0;
};

}  // namespace

Image image_io::read_tga(const std::string& file, const std::string& bytes) { return TgaReader(file, bytes).read(); }

}  // namespace octrad
