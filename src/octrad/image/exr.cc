// OpenEXR files through the OpenEXR library's general interface.
#include <IexBaseExc.h>
#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfIO.h>
#include <ImfInputFile.h>
#include <ImfOutputFile.h>
#include <ImfPartType.h>
#include <ImfStringAttribute.h>
#include <ImfTestFile.h>
#include <ImfVersion.h>
#include <half.h>

#include <algorithm>
#include <cassert>
#include <cstring>
#include <limits>
#include <map>
#include <sstream>
#include <string_view>
#include <tuple>

#include "octrad/base/atomic_file.h"
#include "octrad/base/error.h"
#include "octrad/image/io.h"
#include "octrad/image/io_internal.h"

namespace octrad {
namespace {

// Main picture first, then layers by name; colours and vectors in their usual order, anything else by name.
std::tuple<std::string, int, std::string> channel_order(const std::string& name) {
  const std::size_t dot = name.rfind('.');
  const std::string layer = dot == std::string::npos ? "" : name.substr(0, dot);
  const std::string base = dot == std::string::npos ? name : name.substr(dot + 1);
  static const std::string kOrder[] = {"R", "G", "B", "A", "X", "Y", "Z"};
  const auto* found = std::find(std::begin(kOrder), std::end(kOrder), base);
  return {layer, static_cast<int>(found - std::begin(kOrder)), base};
}

// Reserved by the format or filled in by the library; the rest of the metadata is free text.
bool is_own_key(const std::string& key) { return key == "dataWindow.min" || key == "displayWindow"; }

// The library writes here: errors of a file that it holds itself would be swallowed by its destructor.
class MemoryStream : public Imf::OStream {
 public:
  explicit MemoryStream(const std::string& name) : Imf::OStream(name.c_str()) {}
  void write(const char c[], int n) override {
    const std::size_t end = position_ + static_cast<std::size_t>(n);
    if (end > bytes_.size()) bytes_.resize(end);
    std::copy_n(c, n, bytes_.data() + position_);
    position_ = end;
  }
  uint64_t tellp() override { return position_; }
  void seekp(uint64_t position) override { position_ = position; }
  std::string take() { return std::move(bytes_); }

 private:
  std::string bytes_;
  std::size_t position_ = 0;
};

class InputStream : public Imf::IStream {
 public:
  InputStream(const std::string& name, const std::string& bytes) : Imf::IStream(name.c_str()), bytes_(bytes) {}
  bool read(char c[], int n) override {
    if (n < 0 || static_cast<std::size_t>(n) > bytes_.size() - position_) throw Iex::InputExc("the file is cut off");
    std::copy_n(bytes_.data() + position_, n, c);
    position_ += static_cast<std::size_t>(n);
    return position_ < bytes_.size();
  }
  uint64_t tellg() override { return position_; }
  void seekg(uint64_t position) override {
    if (position > bytes_.size()) throw Iex::InputExc("the file is cut off");
    position_ = static_cast<std::size_t>(position);
  }

 private:
  const std::string& bytes_;
  std::size_t position_ = 0;
};

// Bytes of attributes whose type says how many.
const std::map<std::string_view, std::size_t> kAttributeSizes = {{"box2i", 16},
                                                                 {"box2f", 16},
                                                                 {"chromaticities", 32},
                                                                 {"compression", 1},
                                                                 {"deepImageState", 1},
                                                                 {"double", 8},
                                                                 {"envmap", 1},
                                                                 {"float", 4},
                                                                 {"int", 4},
                                                                 {"keycode", 28},
                                                                 {"lineOrder", 1},
                                                                 {"m33d", 72},
                                                                 {"m33f", 36},
                                                                 {"m44d", 128},
                                                                 {"m44f", 64},
                                                                 {"rational", 8},
                                                                 {"tiledesc", 9},
                                                                 {"timecode", 8},
                                                                 {"v2d", 16},
                                                                 {"v2f", 8},
                                                                 {"v2i", 8},
                                                                 {"v3d", 24},
                                                                 {"v3f", 12},
                                                                 {"v3i", 12}};

std::uint32_t number_at(std::string_view bytes, std::size_t at) {
  std::uint32_t number = 0;
  std::memcpy(&number, bytes.data() + at, sizeof(number));
  return number;
}

// Whether the library, which reads attributes of known types by their own structure, reads exactly `value`.
bool fills_its_size(std::string_view type, std::string_view value) {
  if (const auto known = kAttributeSizes.find(type); known != kAttributeSizes.end())
    return value.size() == known->second;
  std::size_t at = 0;
  if (type == "chlist") {  // names with 16 bytes each; an empty name ends it
    for (std::size_t end; (end = value.find('\0', at)) != at; at = end + 17) {
      if (end == std::string_view::npos || value.size() - end < 17) return false;
    }
    return at + 1 == value.size();
  }
  if (type == "stringvector") {
    while (value.size() - at >= 4) {
      const std::size_t length = number_at(value, at);
      if (length > value.size() - at - 4) return false;
      at += 4 + length;
    }
    return at == value.size();
  }
  if (type == "preview")
    return value.size() >= 8 && std::uint64_t{number_at(value, 0)} * number_at(value, 4) < (1u << 28) &&
           std::size_t{4} * number_at(value, 0) * number_at(value, 4) == value.size() - 8;
  return type != "floatvector" || value.size() % 4 == 0;
}

// The library allocates what an attribute's size says before it reads the attribute, and tables for as many lines as
// the data window has: headers are compared with the file first.
void check_headers(const std::string& file, const std::string& bytes) {
  constexpr int kMaxSide = 131072, kMaxTile = 8192;
  Imf::Header::setMaxImageSize(kMaxSide, kMaxSide);
  Imf::Header::setMaxTileSize(kMaxTile, kMaxTile);
  const auto broken = [&] { throw InputError(file + ": broken EXR header, or one that is cut off"); };
  std::size_t at = 8;  // behind magic and version
  const auto text = [&] {
    const std::size_t end = bytes.find('\0', at), begin = at;
    if (end == std::string::npos || end - at > 255) broken();
    at = end + 1;
    return std::string_view(bytes).substr(begin, end - begin);
  };
  const bool multipart = bytes.size() >= 8 && (bytes[5] & 0x10) != 0;
  for (;;) {  // headers; a file of several parts has an empty one at the end
    if (at >= bytes.size()) broken();
    if (bytes[at] == '\0') return;
    while (at < bytes.size() && bytes[at] != '\0') {
      text();  // name
      const std::string_view type = text();
      if (bytes.size() - at < 4) broken();
      const std::size_t size = number_at(bytes, at);
      at += 4;
      if (size > bytes.size() - at || !fills_its_size(type, std::string_view(bytes).substr(at, size))) broken();
      at += size;
    }
    if (!multipart) return;
    ++at;
  }
}

}  // namespace

Image image_io::read_exr(const std::string& file, const std::string& bytes) {
  try {
    check_headers(file, bytes);
    InputStream stream(file, bytes);
    bool tiled = false, deep = false, multipart = false;
    if (!Imf::isOpenExrFile(stream, tiled, deep, multipart)) throw InputError(file + ": not an OpenEXR file");
    if (deep) throw InputError(file + ": deep EXR files are not supported (flat scanline and tiled ones are)");
    stream.seekg(0);
    Imf::InputFile in(stream, 0);
    const Imf::Header& header = in.header();
    const Imath::Box2i window = header.dataWindow(), display = header.displayWindow();
    const long long width = static_cast<long long>(window.max.x) - window.min.x + 1;
    const long long height = static_cast<long long>(window.max.y) - window.min.y + 1;

    std::vector<std::string> names;
    for (auto c = header.channels().begin(); c != header.channels().end(); ++c) {
      if (c.channel().xSampling != 1 || c.channel().ySampling != 1) {
        throw InputError(file + ": channel " + c.name() +
                         " is subsampled (luminance/chroma), which is not supported: save it as RGB");
      }
      names.push_back(c.name());
    }
    // Compressed and uncompressed, a block of lines or a row of tiles is in memory twice.
    const long long lines = header.hasTileDescription() ? header.tileDescription().ySize : 256;
    check_size(file, width, height, static_cast<long long>(names.size()),
               2 * sizeof(float) * static_cast<std::uint64_t>(width * std::min(lines, height)) * names.size());
    if (!in.isComplete())
      throw InputError(file + ": incomplete EXR file (it was cut off, or not finished by its writer)");
    std::sort(names.begin(), names.end(),
              [](const std::string& a, const std::string& b) { return channel_order(a) < channel_order(b); });

    Image image(static_cast<int>(width), static_cast<int>(height), names);
    const std::size_t stride_x = names.size() * sizeof(float), stride_y = stride_x * static_cast<std::size_t>(width);
    Imf::FrameBuffer buffer;
    for (std::size_t c = 0; c < names.size(); ++c) {
      buffer.insert(names[c], Imf::Slice::Make(Imf::FLOAT, image.data.data() + c, window, stride_x, stride_y));
    }
    in.setFrameBuffer(buffer);
    in.readPixels(window.min.y, window.max.y);

    for (auto a = header.begin(); a != header.end(); ++a) {
      if (const auto* text = dynamic_cast<const Imf::StringAttribute*>(&a.attribute())) {
        if (std::string(a.name()) != "type") image.metadata[a.name()] = text->value();
      }
    }
    // Relative to the display window, so that files of a renderer whose display window is not at 0 0 read the same.
    const long long x = static_cast<long long>(window.min.x) - display.min.x,
                    y = static_cast<long long>(window.min.y) - display.min.y;
    const long long display_width = static_cast<long long>(display.max.x) - display.min.x + 1;
    const long long display_height = static_cast<long long>(display.max.y) - display.min.y + 1;
    if (x != 0 || y != 0) image.metadata["dataWindow.min"] = std::to_string(x) + " " + std::to_string(y);
    if (x != 0 || y != 0 || display_width != width || display_height != height) {
      image.metadata["displayWindow"] = std::to_string(display_width) + " " + std::to_string(display_height);
    }
    return image;
  } catch (const Error&) {
    throw;
  } catch (const std::exception& e) {
    throw InputError(file + ": cannot read EXR file: " + e.what());
  }
}

std::string image_io::exr_bytes(const std::string& file, const Image& image, ExrPrecision precision) {
  assert(image.width > 0 && image.height > 0 && !image.channels.empty());
  assert(image.data.size() == image.pixel_count() * image.channels.size());
  const Imf::PixelType type = precision == ExrPrecision::half ? Imf::HALF : Imf::FLOAT;

  Imath::V2i origin(0, 0), display(image.width, image.height);
  const auto read_pair = [&](const char* key, Imath::V2i& pair) {
    const auto found = image.metadata.find(key);
    if (found == image.metadata.end()) return;
    std::istringstream text(found->second);
    if (!(text >> pair.x >> pair.y))
      throw InputError(file + ": metadata " + key + " must be two integers, not \"" + found->second + "\"");
  };
  read_pair("dataWindow.min", origin);
  read_pair("displayWindow", display);
  constexpr int kFar = 1 << 20;
  if (std::max({std::abs(origin.x), std::abs(origin.y), display.x, display.y}) > kFar || display.x < 1 ||
      display.y < 1) {
    throw InputError(file + ": data or display window out of range");
  }
  const Imath::Box2i window(origin, origin + Imath::V2i(image.width - 1, image.height - 1));

  std::vector<half> halves;
  if (precision == ExrPrecision::half) {
    halves.resize(image.data.size());
    std::transform(image.data.begin(), image.data.end(), halves.begin(), [](float v) { return half(v); });
  }
  MemoryStream stream(file);
  try {
    Imf::Header header(Imath::Box2i(Imath::V2i(0, 0), display - Imath::V2i(1, 1)), window);
    header.compression() = Imf::ZIP_COMPRESSION;
    for (const auto& [key, value] : image.metadata) {
      if (!is_own_key(key)) header.insert(key, Imf::StringAttribute(value));
    }
    const std::size_t value_size = precision == ExrPrecision::half ? sizeof(half) : sizeof(float);
    const std::size_t stride_x = image.channels.size() * value_size,
                      stride_y = stride_x * static_cast<std::size_t>(image.width);
    const char* base = precision == ExrPrecision::half ? reinterpret_cast<const char*>(halves.data())
                                                       : reinterpret_cast<const char*>(image.data.data());
    Imf::FrameBuffer buffer;
    for (std::size_t c = 0; c < image.channels.size(); ++c) {
      assert(image.channel(image.channels[c]) == static_cast<int>(c));  // names are unique
      header.channels().insert(image.channels[c], Imf::Channel(type));
      buffer.insert(image.channels[c], Imf::Slice::Make(type, base + c * value_size, window, stride_x, stride_y));
    }
    Imf::OutputFile out(stream, header, 0);
    out.setFrameBuffer(buffer);
    out.writePixels(image.height);
  } catch (const std::exception& e) {
    throw IoError(file + ": cannot write EXR file: " + e.what());
  }
  return stream.take();
}

void write_exr(const std::string& file, const Image& image, ExrPrecision precision) {
  require_writable(file);
  const std::string bytes = image_io::exr_bytes(file, image, precision);
  AtomicFile out(file);
  out.write(bytes);
  out.commit();
}

}  // namespace octrad
