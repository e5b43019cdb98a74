// OpenEXR files through the OpenEXR library's general interface.
#include <IexBaseExc.h>
#include <ImfChannelList.h>
#include <ImfChromaticities.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfIO.h>
#include <ImfInputFile.h>
#include <ImfInputPart.h>
#include <ImfMultiPartInputFile.h>
#include <ImfOutputFile.h>
#include <ImfPartType.h>
#include <ImfStandardAttributes.h>
#include <ImfStringAttribute.h>
#include <ImfTestFile.h>
#include <ImfVersion.h>
#include <half.h>

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <cstring>
#include <map>
#include <optional>
#include <set>
#include <sstream>
#include <string_view>
#include <tuple>

#include "octrad/base/atomic_file.h"
#include "octrad/base/error.h"
#include "octrad/base/lower_case.h"
#include "octrad/base/memory_limit.h"
#include "octrad/image/io.h"
#include "octrad/image/io_internal.h"
#include "octrad/image/size_limit.h"

namespace octrad {
namespace {

// By the numbers that the format gives them.
constexpr std::string_view kExrCompressions[] = {"none",  "rle", "zips", "zip",  "piz",
                                                 "pxr24", "b44", "b44a", "dwaa", "dwab"};
static_assert(Imf::ZIP_COMPRESSION == 3 && Imf::DWAB_COMPRESSION == 9);

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
  constexpr int kMaxTile = 8192;
  Imf::Header::setMaxImageSize(kMostFilmPixels, kMostFilmPixels);
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
  std::uint64_t kept = 0;  // by the library, about: names of 256 bytes, in its lists of attributes and of channels
  for (;;) {               // headers; a file of several parts has an empty one at the end
    if (at >= bytes.size()) broken();
    if (bytes[at] == '\0') break;
    while (at < bytes.size() && bytes[at] != '\0') {
      text();  // name
      const std::string_view type = text();
      if (bytes.size() - at < 4) broken();
      const std::size_t size = number_at(bytes, at);
      at += 4;
      if (size > bytes.size() - at || !fills_its_size(type, std::string_view(bytes).substr(at, size))) broken();
      at += size;
      kept += 700 + size * (type == "chlist" ? 150 : type == "stringvector" ? 24 : 2);
    }
    if (!multipart) break;
    ++at;
  }
  ask_memory(kept, file + ": its header");
}

// Pixels along an axis of a window; its ends are 32-bit numbers of a file.
long long side(const Imath::Box2i& window, int axis) {
  return static_cast<long long>(window.max[axis]) - window.min[axis] + 1;
}

// Lines that are in memory twice while they are read, compressed and uncompressed. A block of lines may inflate to its
// full height also where the picture ends before.
long long lines_at_once(const Imf::Header& header) {
  switch (header.compression()) {
    case Imf::NO_COMPRESSION:
    case Imf::RLE_COMPRESSION:
    case Imf::ZIPS_COMPRESSION: return 1;
    case Imf::ZIP_COMPRESSION:
    case Imf::PXR24_COMPRESSION: return 16;
    case Imf::DWAB_COMPRESSION: return 256;
    default: return 32;
  }
}

// Bytes that the library needs beside the picture to read a part: of all its channels, whether or not they are wanted.
// Of tiles, a row of those that the picture has, and one whole tile three times: as read, inflated, and put in order.
std::uint64_t bytes_beside(const Imf::Header& header, long long width, long long height) {
  std::uint64_t pixel = 0;
  const Imf::ChannelList& channels = header.channels();
  for (auto c = channels.begin(); c != channels.end(); ++c)
    pixel += c.channel().type == Imf::HALF ? sizeof(half) : sizeof(float);
  if (!header.hasTileDescription()) return 2 * pixel * static_cast<std::uint64_t>(width * lines_at_once(header));
  const Imf::TileDescription& tile = header.tileDescription();
  const auto across = static_cast<std::uint64_t>(width);
  return pixel * (across * std::min<std::uint64_t>(tile.ySize, static_cast<std::uint64_t>(height)) +
                  3 * std::uint64_t{tile.xSize} * tile.ySize);
}

// A part of a file, and its channels by their names there and in the picture.
struct Part {
  const Imf::Header* header;
  int number;
  bool complete;
  std::vector<std::pair<std::string, std::string>> channels;
};

// An open file and the parts of it that are of the picture: flat, of the first one's size.
struct OpenFile {
  std::optional<Imf::InputFile> single;
  std::optional<Imf::MultiPartInputFile> multiple;
  std::vector<Part> parts;

  OpenFile(const std::string& file, Imf::IStream& stream);
  void read(const Part& part, const Imf::FrameBuffer& buffer, const Imath::Box2i& window);
};

OpenFile::OpenFile(const std::string& file, Imf::IStream& stream) {
  bool tiled = false, deep = false, multipart = false;
  if (!Imf::isOpenExrFile(stream, tiled, deep, multipart)) throw InputError(file + ": not an OpenEXR file");
  stream.seekg(0);
  if (multipart) {
    multiple.emplace(stream, 0);
    for (int i = 0; i < multiple->parts(); ++i) {
      const Imf::Header& header = multiple->header(i);
      if (header.hasType() && Imf::isDeepData(header.type())) continue;
      // Parts of another size are other pictures.
      if (!parts.empty() && header.dataWindow() != parts[0].header->dataWindow()) continue;
      parts.push_back({&header, i, multiple->partComplete(i), {}});
    }
  } else if (!deep) {
    single.emplace(stream, 0);
    parts.push_back({&single->header(), 0, single->isComplete(), {}});
  }
  if (parts.empty()) throw InputError(file + ": deep EXR files are not supported (flat scanline and tiled ones are)");
}

void OpenFile::read(const Part& part, const Imf::FrameBuffer& buffer, const Imath::Box2i& window) {
  if (multiple) {
    Imf::InputPart in(*multiple, part.number);
    in.setFrameBuffer(buffer);
    in.readPixels(window.min.y, window.max.y);
    multiple->flushPartCache();  // the library would keep what it needed for this part
  } else {
    single->setFrameBuffer(buffer);
    single->readPixels(window.min.y, window.max.y);
  }
}

// Channels of a further part without a layer get the part's name as one. What another part has already is left out.
void find_channels(const std::string& file, Part& part, bool further, std::set<std::string>& known) {
  const Imf::ChannelList& channels = part.header->channels();
  for (auto c = channels.begin(); c != channels.end(); ++c) {
    const std::string own = c.name();
    if (c.channel().xSampling != 1 || c.channel().ySampling != 1) {
      if (further) continue;
      const bool chroma = own == "RY" || own == "BY";
      throw InputError(file + ": channel " + own + " is subsampled" +
                       (chroma ? ": a luminance/chroma file (Y, RY, BY)" : "") +
                       ", which is not supported: save it as RGB");
    }
    std::string name = own;
    if (further && own.find('.') == std::string::npos && part.header->hasName()) {
      name = part.header->name();
      name += '.' + own;
    }
    if (known.insert(name).second) part.channels.emplace_back(own, name);
  }
}

// Where no channels are called R, G and B (nor Y), those of the layer that is the picture, and their short names: "r",
// "Red"; "ViewLayer.Combined.R" and the grey "V" of Blender; "rgba.R", "beauty.R" of others; else the only layer of
// colours.
std::map<std::string, std::string> main_picture(const std::vector<std::string>& names, bool own) {
  const auto has = [&](const std::string& name) { return std::find(names.begin(), names.end(), name) != names.end(); };
  if (own || has("Y") || (has("R") && has("G") && has("B"))) return {};
  static const std::pair<const char*, const char*> kColors[] = {
      {"r", "R"}, {"g", "G"}, {"b", "B"}, {"a", "A"}, {"red", "R"}, {"green", "G"}, {"blue", "B"}, {"alpha", "A"}};
  std::map<std::string, std::map<std::string, std::string>> layers;  // channels by their short names
  for (const std::string& name : names) {
    const std::size_t dot = name.rfind('.');
    const std::string layer = dot == std::string::npos ? "" : name.substr(0, dot),
                      base = lower_case(dot == std::string::npos ? name : name.substr(dot + 1));
    for (const auto& [spelled, color] : kColors) {
      if (base == spelled) layers[layer].emplace(color, name);
    }
  }
  std::erase_if(layers, [](const auto& layer) {
    return !layer.second.count("R") || !layer.second.count("G") || !layer.second.count("B");
  });
  static const char* const kMain[] = {"", "combined", "beauty", "rgba", "rgb", "color", "image", "radiance"};
  const auto rank = [](const std::string& layer) {
    const std::string last = lower_case(layer.substr(layer.rfind('.') + 1));
    return static_cast<std::size_t>(std::find(std::begin(kMain), std::end(kMain), last) - std::begin(kMain));
  };
  const auto best = std::min_element(layers.begin(), layers.end(),
                                     [&](const auto& a, const auto& b) { return rank(a.first) < rank(b.first); });
  std::map<std::string, std::string> result;
  if (names == std::vector<std::string>{"V"}) result.emplace("V", "Y");  // a grey picture of Blender 5
  if (best == layers.end() || (layers.size() > 1 && rank(best->first) == std::size(kMain))) return result;
  for (const auto& [color, name] : best->second) {
    if (!has(color)) result.emplace(name, color);
  }
  return result;
}

// Names of the picture's channels in their order there, and where those of the file are.
struct ChannelOrder {
  std::vector<std::string> names;
  std::map<std::string, std::size_t> index;
};

ChannelOrder order_channels(const std::vector<std::string>& written, bool own) {
  const std::map<std::string, std::string> short_names = main_picture(written, own);
  std::vector<std::pair<std::string, std::string>> order;  // final name, name in the file
  for (const std::string& name : written) {
    const auto found = short_names.find(name);
    order.emplace_back(found != short_names.end() ? found->second : name, name);
  }
  std::sort(order.begin(), order.end(),
            [](const auto& a, const auto& b) { return channel_order(a.first) < channel_order(b.first); });
  ChannelOrder result;
  for (const auto& [name, in_file] : order) {
    result.index[in_file] = result.names.size();
    result.names.push_back(name);
  }
  return result;
}

// Texts of the header, and the windows of a picture that is a part of a larger one.
std::map<std::string, std::string> metadata_of(const Imf::Header& header, bool multipart) {
  std::map<std::string, std::string> result;
  for (auto a = header.begin(); a != header.end(); ++a) {
    if (const auto* text = dynamic_cast<const Imf::StringAttribute*>(&a.attribute())) {
      const std::string key = a.name();
      if (key != "type" && !(multipart && key == "name")) result[key] = text->value();
    }
  }
  // Relative to the display window, so that files of a renderer whose display window is not at 0 0 read the same.
  const Imath::Box2i window = header.dataWindow(), display = header.displayWindow();
  const long long x = static_cast<long long>(window.min.x) - display.min.x,
                  y = static_cast<long long>(window.min.y) - display.min.y;
  if (x != 0 || y != 0) result["dataWindow.min"] = std::to_string(x) + " " + std::to_string(y);
  if (x != 0 || y != 0 || side(display, 0) != side(window, 0) || side(display, 1) != side(window, 1))
    result["displayWindow"] = std::to_string(side(display, 0)) + " " + std::to_string(side(display, 1));
  return result;
}

// The matrix (a row of colours times it) from primaries of the file to Rec. 709, without adapting the white point; none
// where they are Rec. 709 or no primaries at all.
std::optional<Imath::M44f> from_primaries(const Imf::Header& header) {
  if (!Imf::hasChromaticities(header)) return std::nullopt;
  const Imf::Chromaticities own = Imf::chromaticities(header), rec709;
  const auto near = [](Imath::V2f a, Imath::V2f b) { return (a - b).length() < 1e-3f; };
  if (near(own.red, rec709.red) && near(own.green, rec709.green) && near(own.blue, rec709.blue) &&
      near(own.white, rec709.white))
    return std::nullopt;
  try {
    const Imath::M44f matrix = Imf::RGBtoXYZ(own, 1.0f) * Imf::XYZtoRGB(rec709, 1.0f);
    const bool finite = std::all_of(&matrix[0][0], &matrix[0][0] + 16, [](float v) { return std::isfinite(v); });
    return finite ? std::optional(matrix) : std::nullopt;
  } catch (const std::exception&) {
    return std::nullopt;
  }
}

// The main colours become linear Rec. 709, as in Mitsuba: from other primaries (`chromaticities`), or from channels X,
// Y and Z, which become R, G and B.
void to_rec709(const Imf::Header& header, Image& image) {
  const auto places = [&](const std::array<const char*, 3>& names) {
    return std::array{image.channel(names[0]), image.channel(names[1]), image.channel(names[2])};
  };
  constexpr std::array kRgb{"R", "G", "B"};
  const auto is_there = [](int place) { return place >= 0; };
  std::array<int, 3> at = places(kRgb);
  std::optional<Imath::M44f> matrix;
  if (std::ranges::all_of(at, is_there)) {
    matrix = from_primaries(header);
  } else if (std::ranges::none_of(at, is_there)) {
    at = places({"X", "Y", "Z"});
    if (!std::ranges::all_of(at, is_there)) return;
    matrix = Imf::XYZtoRGB(Imf::Chromaticities(), 1.0f);
    for (std::size_t c = 0; c < 3; ++c) image.channels[static_cast<std::size_t>(at[c])] = kRgb[c];
  }
  if (!matrix) return;
  const std::size_t stride = image.channels.size();
  for (std::size_t i = 0; i < image.pixel_count(); ++i) {
    float* pixel = image.data.data() + i * stride;
    const Imath::V3f color = Imath::V3f(pixel[at[0]], pixel[at[1]], pixel[at[2]]) * *matrix;
    for (unsigned c = 0; c < 3; ++c) pixel[at[c]] = color[c];
  }
}

}  // namespace

Image image_io::read_exr(const std::string& file, const std::string& bytes) {
  try {
    check_headers(file, bytes);
    InputStream stream(file, bytes);
    OpenFile open(file, stream);
    const Imf::Header& first = *open.parts[0].header;
    const Imath::Box2i window = first.dataWindow();
    const long long width = side(window, 0), height = side(window, 1);

    std::set<std::string> known;
    for (Part& part : open.parts) find_channels(file, part, &part != open.parts.data(), known);
    std::uint64_t beside = 0;
    for (const Part& part : open.parts) beside = std::max(beside, bytes_beside(*part.header, width, height));
    check_size(file, width, height, static_cast<long long>(known.size()), beside);
    for (const Part& part : open.parts) {
      if (!part.complete)
        throw InputError(file + ": incomplete EXR file (it was cut off, or not finished by its writer)");
    }
    const bool own = first.findTypedAttribute<Imf::StringAttribute>("octrad.version") != nullptr;
    const ChannelOrder channels = order_channels({known.begin(), known.end()}, own);

    Image image(static_cast<int>(width), static_cast<int>(height), channels.names);
    const std::size_t stride_x = channels.names.size() * sizeof(float),
                      stride_y = stride_x * static_cast<std::size_t>(width);
    for (const Part& part : open.parts) {
      if (part.channels.empty()) continue;
      Imf::FrameBuffer buffer;
      for (const auto& [in_part, name] : part.channels) {
        float* data = image.data.data() + channels.index.at(name);
        buffer.insert(in_part, Imf::Slice::Make(Imf::FLOAT, data, window, stride_x, stride_y));
      }
      open.read(part, buffer, window);
    }
    image.metadata = metadata_of(first, open.multiple.has_value());
    to_rec709(first, image);
    return image;
  } catch (const Error&) {
    throw;
  } catch (const std::exception& e) {
    throw InputError(file + ": cannot read EXR file: " + e.what());
  }
}

const std::vector<std::string>& exr_compressions() {
  static const std::vector<std::string> names(std::begin(kExrCompressions), std::end(kExrCompressions));
  return names;
}

std::string image_io::exr_bytes(const std::string& file, const Image& image, const ExrSettings& settings) {
  assert(image.width > 0 && image.height > 0 && !image.channels.empty());
  assert(image.data.size() == image.pixel_count() * image.channels.size());
  const ExrPrecision precision = settings.precision;
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
    std::transform(image.data.begin(), image.data.end(), halves.begin(),
                   [](float v) { return half(std::isfinite(v) ? std::clamp(v, -65504.0f, 65504.0f) : v); });
  }
  MemoryStream stream(file);
  try {
    Imf::Header header(Imath::Box2i(Imath::V2i(0, 0), display - Imath::V2i(1, 1)), window);
    header.compression() = static_cast<Imf::Compression>(
        std::find(std::begin(kExrCompressions), std::end(kExrCompressions), settings.compression) -
        std::begin(kExrCompressions));
    assert(header.compression() < Imf::NUM_COMPRESSION_METHODS);
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

void write_exr(const std::string& file, const Image& image, const ExrSettings& settings) {
  require_writable(file);
  write_file(file, image_io::exr_bytes(file, image, settings));
}

}  // namespace octrad
